"""Upsampling of clouds: `upsample_as` as a recipe is evaluated, `densify` to any number of points."""

from pcsr.upsample.dense import densify
from pcsr.upsample.protocol import points_at_once, upsample_as
from pcsr.upsample.whole import upsample

__all__ = ["densify", "points_at_once", "upsample", "upsample_as"]
