"""Coordinates of any size: scaled by a power of two, exactly, until their squares and cubes fit into doubles."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

ORDINARY = 100
"""Coordinates between 2⁻¹⁰⁰ and 2¹⁰⁰ stay as they are: up to their ninth powers fit into doubles."""


def exponent(clouds: Sequence[Float[np.ndarray, "_ 3"]]) -> int:
    """The power of two that all coordinates may be divided by to be ordinary; 0 where they are.

    Divided by it, the largest is between a half and 1. Sums, products and roots of such numbers are the same as of
    those that they were made of, but for the power of two, unless these were too large or small for doubles.

    Args:
        clouds: all in one frame; finite.
    """
    largest = max((float(np.abs(cloud).max()) for cloud in clouds if cloud.size), default=0.0)
    power = int(np.frexp(largest)[1])
    return power if abs(power) > ORDINARY else 0


def scaled(points: Float[np.ndarray, "*n 3"], power: int) -> Float[np.ndarray, "*n 3"]:
    """Points times two to a power; the same array where the power is 0."""
    if power == 0:
        return points
    with np.errstate(under="ignore", over="ignore"):
        made: Float[np.ndarray, "*n 3"] = np.ldexp(points, power)
    return made
