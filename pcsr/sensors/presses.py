"""Presses of a ball: images from which a sensor is calibrated, and the region that each ball changed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from pcsr.errors import UserError
from pcsr.sensors import polynomial
from pcsr.sensors.colour import UNCHANGED, colour_change, strength
from pcsr.sensors.images import Image

STRIDE = 2
"""Step between the pixels, along both axes, to which slopes are fitted."""
REGION = 0.2
"""Share of the greatest change of colour from which on a pixel belongs to the region that the ball changed."""
WIDE = 1.5
"""Half the side of the square of pixels around a ball, in radii of the changed region."""
SMALLEST = 6.0
"""Least radius of the changed region in pixels."""
BEYOND = 0.6
"""A ball is cut off by the edge where its region's centre is closer to it than this share of the region's radius."""
SIZES = (0.2, 3.0)
"""Least and greatest radius of the changed region, in radii of the ball. On real sensors it is 0.6 to 1.6."""
CUT_OFF = "the ball is cut off by the edge of the image"
"""Reason why a press is refused whose contact is not wholly in view."""


@dataclass(frozen=True, eq=False)
class PressImage:
    """Image of a ball that is pressed into the gel.

    Examples:
        >>> from pcsr.sensors import PressImage, ball_indentation, shaded
        >>> image = shaded(ball_indentation((120, 160), 0.12, 6.0, 0.8, (80.0, 60.0)), 0.12)
        >>> PressImage("0.png", image, diameter=6.0).image.shape
        (120, 160, 3)
    """

    name: str
    image: Image
    diameter: float
    """Diameter of the ball in millimetres."""


@dataclass(frozen=True, eq=False)
class Press:
    """Pixels around a pressed ball, with the monomials of the slopes there. Lengths are in pixels."""

    name: str
    diameter: float
    """Diameter of the ball in millimetres."""
    ball: float
    """Radius of the ball."""
    change: Float[np.ndarray, "h w 3"]
    """Change of colour in per cent."""
    centre: Float[np.ndarray, "2"]
    """Column and row of the middle of the region that the ball changed."""
    radius: float
    """Radius of the disc that has the area of the region."""
    rows: Float[np.ndarray, " n"]
    columns: Float[np.ndarray, " n"]
    monomials: Float[np.ndarray, "n k"]


def press_of(press: PressImage, background: Image, mm_per_pixel: float) -> Press:
    """Find the region that a ball changed.

    Raises:
        UserError: the image cannot be used; the message has the reason.
    """
    change = colour_change(press.image, background)
    smooth = ndimage.gaussian_filter(strength(change), 2.0)
    labels, count = ndimage.label(smooth > max(UNCHANGED, REGION * smooth.max()))
    if count == 0:
        raise UserError(
            f"no ball: the colour changes by {smooth.max():.0f} % at most, and a contact by more than {UNCHANGED:.0f} %"
        )
    sizes = ndimage.sum_labels(np.ones_like(labels), labels, range(1, count + 1))
    rows, columns = np.nonzero(labels == 1 + int(np.argmax(sizes)))
    radius = float(np.sqrt(len(rows) / np.pi))
    weights = smooth[rows, columns]
    centre = np.array([np.average(columns, weights=weights), np.average(rows, weights=weights)])
    height, width = smooth.shape
    if radius < SMALLEST:
        raise UserError(f"no ball: the changed region has a radius of {radius:.1f} pixels, less than {SMALLEST:.0f}")
    ball = press.diameter / 2 / mm_per_pixel
    if not SIZES[0] * ball < radius < SIZES[1] * ball:
        raise UserError(
            f"the changed region has a radius of {radius * mm_per_pixel:.3g} mm, {radius / ball:.2g} times that of a "
            f"ball of {press.diameter:g} mm: check the ball's diameter and mm_per_pixel, which is {mm_per_pixel:g}"
        )
    if min(centre[0], centre[1], width - 1 - centre[0], height - 1 - centre[1]) < BEYOND * radius:
        raise UserError(CUT_OFF)
    low = np.maximum(0, (centre - WIDE * radius).astype(int))
    high = np.minimum([width, height], (centre + WIDE * radius).astype(int) + 1)
    grid = np.mgrid[low[1] : high[1] : STRIDE, low[0] : high[0] : STRIDE].reshape(2, -1)
    means = ndimage.uniform_filter(change, (STRIDE, STRIDE, 1))[grid[0], grid[1]]
    pixels = grid.astype(float)
    return Press(
        name=press.name,
        diameter=press.diameter,
        ball=ball,
        change=change,
        centre=centre,
        radius=radius,
        rows=pixels[0],
        columns=pixels[1],
        monomials=polynomial.monomials(means, pixels[0], pixels[1], smooth.shape),
    )


def cut_off(press: Press, centre: Float[np.ndarray, "2"], rim: float) -> bool:
    """Tell whether a part of a contact lies beyond the edge of the image."""
    height, width = press.change.shape[:2]
    return bool(min(centre[0], centre[1], width - 1 - centre[0], height - 1 - centre[1]) < rim)


def spread(centres: Float[np.ndarray, "n 2"], count: int) -> list[int]:
    """Return the indices of presses that are spread over the gel.

    The first is the most central one, and each further one is the farthest from all before it.
    """
    chosen = [int(np.argmin(np.linalg.norm(centres - centres.mean(0), axis=1)))]
    while len(chosen) < min(count, len(centres)):
        apart = np.linalg.norm(centres[:, None] - centres[chosen], axis=-1).min(1)
        apart[chosen] = -1  # two presses may have the same centre
        chosen.append(int(np.argmax(apart)))
    return chosen
