"""From a sparse cloud to a dense one: whole, in one pass, or of any size and to any number of points, in patches."""

from pcsr.upsample.dense import densify
from pcsr.upsample.protocol import points_at_once, upsample_as
from pcsr.upsample.whole import upsample

__all__ = ["densify", "points_at_once", "upsample", "upsample_as"]
