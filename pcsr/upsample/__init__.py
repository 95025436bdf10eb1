"""Upsampling of clouds: `densify` to any number of points, `upsample_as` as a recipe is evaluated."""

from pcsr.upsample.dense import densify
from pcsr.upsample.protocol import points_at_once, protocol, thread_limit, upsample_as, upsample_plainly
from pcsr.upsample.whole import upsample

__all__ = ["densify", "points_at_once", "protocol", "thread_limit", "upsample", "upsample_as", "upsample_plainly"]
