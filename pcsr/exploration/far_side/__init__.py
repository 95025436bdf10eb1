"""Guess of the far side of an object that was seen from one side."""

from pcsr.exploration.far_side.guess import FarSide, far_side
from pcsr.exploration.far_side.viewing import seen_from

__all__ = ["FarSide", "far_side", "seen_from"]
