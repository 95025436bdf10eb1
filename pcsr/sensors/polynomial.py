"""Slopes of a gel by a polynomial in the change of colour and the position.

Photometric stereo (Johnson and Adelson, 2009): the colour that a pixel of a gel reflects under coloured lights depends
on the slope of the gel and on where the pixel lies. The slopes along x and y, as angles, are polynomials of total
degree 3 in the changes of red, green and blue and the pixel's position. Each monomial contains a change of colour, so
that the gel is at rest where the colour is that of the background.
"""

import itertools

import numpy as np
from jaxtyping import Float, Int

DEGREE = 3
"""Total degree of the polynomials."""
SCALE = 50.0
"""Change of colour, in per cent, that is 1 in the polynomials."""
STEEPEST = 1.4
"""Greatest angle of a slope in radians, 80 degrees."""

EXPONENTS: Int[np.ndarray, "k 5"] = np.array(
    [
        powers
        for powers in itertools.product(range(DEGREE + 1), repeat=5)
        if sum(powers) <= DEGREE and sum(powers[:3]) > 0
    ]
)
"""Exponents of red, green, blue, x and y in each monomial."""


def monomials(
    change: Float[np.ndarray, "n 3"],
    rows: Float[np.ndarray, " n"],
    columns: Float[np.ndarray, " n"],
    size: tuple[int, int],
) -> Float[np.ndarray, "n k"]:
    """Evaluate each monomial at pixels.

    Args:
        change: changes of colour in per cent.
        rows: rows of the pixels.
        columns: columns of the pixels.
        size: rows and columns of the image. Positions are relative to its centre, and 1 at the end of its longer side.
    """
    half = max(size) / 2
    x, y = (columns - (size[1] - 1) / 2) / half, (rows - (size[0] - 1) / 2) / half
    values = np.stack([*(change.T / SCALE), x, y])
    powers = np.ones((DEGREE + 1, *values.shape))
    for power in range(1, DEGREE + 1):
        powers[power] = powers[power - 1] * values
    found = np.ones((len(EXPONENTS), len(x)))
    for number, exponents in enumerate(EXPONENTS):
        for variable in np.flatnonzero(exponents):
            found[number] *= powers[exponents[variable], variable]
    return found.T


def slopes(monomials: Float[np.ndarray, "n k"], coefficients: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "n 2"]:
    """Return the slopes along x (columns) and y (rows) of the indentation, as tangents."""
    angles = np.clip(monomials @ coefficients, -STEEPEST, STEEPEST)
    tangents: Float[np.ndarray, "n 2"] = np.tan(angles)
    return tangents
