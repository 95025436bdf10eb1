"""Exact scaling of very large or small coordinates by a power of two, so that their powers fit into doubles."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

ORDINARY = 100
"""Coordinates between 2⁻¹⁰⁰ and 2¹⁰⁰ are not scaled: their powers up to the ninth fit into doubles."""


def exponent(clouds: Sequence[Float[np.ndarray, "_ 3"]]) -> int:
    """Return the exponent of the power of two by which coordinates should be divided; 0 if they need no scaling.

    After the division the largest coordinate is between 1/2 and 1. Sums, products and roots of the scaled coordinates
    equal those of the original ones up to the power of two, except where the latter overflow or underflow.

    Args:
        clouds: finite clouds in the same frame.
    """
    largest = max((float(np.abs(cloud).max()) for cloud in clouds if cloud.size), default=0.0)
    power = int(np.frexp(largest)[1])
    return power if abs(power) > ORDINARY else 0


def scaled(lengths: Float[np.ndarray, "*n"], power: int) -> Float[np.ndarray, "*n"]:
    """Multiply coordinates or other lengths by 2 to the given power; return the same array if the power is 0."""
    if power == 0:
        return lengths
    with np.errstate(under="ignore", over="ignore"):
        product: Float[np.ndarray, "*n"] = np.ldexp(lengths, power)
    return product
