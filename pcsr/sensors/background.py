"""Coarse colours of a background, by which a sensor is recognized, and mistakes that they show."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.sensors.images import Image

OTHER_SENSOR = 0.4
"""Difference of two backgrounds above which they are of different sensors."""
DOUBTFUL = 0.15
"""Difference of two backgrounds above which they may be of different sensors."""
GRID = (6, 8)
"""Rows and columns of the coarse grid of a background."""
NOTICED = 0.03
"""Difference from which on it can be a mistake of the orientation or the order of the colours."""
FAR_CLOSER = 0.5
"""An image that comes closer by this factor if it is turned, or its colours are swapped, is made that way."""
CLOSE = 0.15
"""Difference up to which an image is of the sensor at all: a touch differs by up to 0.1 from its background."""
SAME = 0.005
"""Difference up to which a background is that of the calibration, but for noise."""
SHOWS_TOUCH = 1 / 3
"""An image that is closer to the calibration's background than its own background by this factor is swapped with it.

Light that drifts changes both. Presses onto a GelSight Mini differ by 0.01 to 0.03 from their background, presses onto
a DIGIT by 0.05 to 0.1.
"""

Grid = Float[np.ndarray, "r c 3"]
VARIANTS: dict[str, Callable[[Grid], Grid]] = {
    "its red and blue were swapped": lambda grid: grid[..., ::-1],
    "it were upside down": lambda grid: grid[::-1],
    "it were mirrored": lambda grid: grid[:, ::-1],
    "it were turned by half a turn": lambda grid: grid[::-1, ::-1],
}
"""Mistakes of an image, and how each is undone in its coarse colours."""


def coarse(image: Image) -> Grid:
    """Return the mean colours of an image in a coarse grid, in steps of 0.1 as the file of a calibration has them."""
    sums, pixels = image, np.ones(1)
    for axis, parts in enumerate(GRID):
        length, more = divmod(image.shape[axis], parts)
        sizes = np.full(parts, length) + (np.arange(parts) < more)
        sums = np.add.reduceat(sums, np.cumsum(sizes) - sizes, axis=axis, dtype=np.int64)
        pixels = pixels[..., None] * sizes
    means: Grid = (sums / pixels.reshape(*GRID, 1)).round(1)
    return means


def difference(one: Grid, other: Grid) -> float:
    """Return the mean difference of coarse colours, as a share of the mean of the second."""
    return float(np.abs(one - other).mean() / max(other.mean(), 1e-9))


def check_orientation(image: Grid, other: Grid, what: str, than: str) -> None:
    """Check that an image is not turned, mirrored, or of another order of its colours than one of the same sensor.

    Args:
        image: coarse colours of the image.
        other: coarse colours of the other image.
        what: what the image is, for the message: "its background".
        than: what the other image is, for the message: "the calibration's".

    Raises:
        UserError: it is.
    """
    apart = difference(image, other)
    if apart < NOTICED:
        return
    found = {mistake: difference(undone(image), other) for mistake, undone in VARIANTS.items()}
    likeliest = min(found, key=lambda mistake: found[mistake])
    if found[likeliest] < min(CLOSE, FAR_CLOSER * apart):
        raise UserError(f"{what} differs from {than} as if {likeliest}: take both in the same way")


def check_not_swapped(image: Grid, background: Grid, calibrated: Grid) -> None:
    """Check that a background is that of an untouched gel, by the background of the sensor's calibration.

    Raises:
        UserError: the image is far closer to the calibration's background than its own background is.
    """
    apart = difference(background, calibrated)
    if apart > SAME and difference(image, calibrated) < SHOWS_TOUCH * apart:
        raise UserError(
            "its background shows a touch or is of another sensor, or the two are swapped: it is closer to the "
            "calibration's background than its own background is"
        )


def doubt(background: Image, calibrated: Grid, what: str, sensor: str) -> str | None:
    """Return a remark if a background may be of another sensor than the calibrated one; None if not.

    Args:
        background: the image.
        calibrated: coarse colours of the background of the calibration.
        what: what the image is, for the remark: "its background".
        sensor: name of the calibrated sensor.
    """
    apart = difference(coarse(background), calibrated)
    if apart <= DOUBTFUL:
        return None
    return f"{what} differs by {apart:.0%} from that of the calibration: is it of the sensor '{sensor}'?"
