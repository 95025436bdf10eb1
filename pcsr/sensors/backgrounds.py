"""Coarse colours of a background, by which a calibration recognizes another sensor."""

import numpy as np
from jaxtyping import Float

from pcsr.sensors.images import Image

GRID = (6, 8)
"""Rows and columns of the coarse grid of a background."""
OTHER_SENSOR = 0.4
"""Mean difference of two backgrounds' colours, as a share of their mean, above which they are of different sensors."""


def coarse(background: Image) -> Float[np.ndarray, "r c 3"]:
    """Return the mean colours of a background in a coarse grid, in steps of 0.1 as its file has them."""
    parts = [np.array_split(rows, GRID[1], axis=1) for rows in np.array_split(background, GRID[0], axis=0)]
    return np.array([[part.mean((0, 1)) for part in row] for row in parts]).round(1)
