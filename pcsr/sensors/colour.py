"""Change of a tactile sensor's image by a touch."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from pcsr.errors import UserError
from pcsr.sensors.images import Image

UNCHANGED = 8.0
"""Change of colour, in per cent of the background, up to which the gel is taken to be untouched."""
MARGIN = 6
"""Pixels by which the changed part of an image is extended, as the slopes fade out beyond it."""
DARKEST = 16.0
"""Level, of 255, below which the background is not taken to be: in the dark a change is noise."""
SATURATED = 0.5
"""Greatest share of saturated pixels."""
BLACK = 8.0
"""Mean level up to which an image is black."""
EVERYWHERE = 0.7
"""Share of the image whose colour a touch can change. A change of more is of another sensor or light, or an error."""


def colour_change(image: Image, background: Image) -> Float[np.ndarray, "rows columns 3"]:
    """Compute the change of colour at each pixel in per cent of the background.

    The median over the image is taken off: it is a drift of the light, as a touch changes a part of the image only.

    Args:
        image: image of the touch.
        background: image of the untouched gel.

    Raises:
        UserError: the sizes differ, or an image is black, saturated, or changed almost everywhere.
    """
    if image.shape != background.shape:
        sizes = [f"{one.shape[1]} x {one.shape[0]}" for one in (image, background)]
        raise UserError(f"it has {sizes[0]} pixels, but its background {sizes[1]}: use images of one size")
    check_exposure(background, "its background")
    check_exposure(image, "it")
    change: Float[np.ndarray, "rows columns 3"] = np.subtract(image, background, dtype=np.float64)
    change -= [_median(image[..., k].astype(np.int16) - background[..., k]) for k in range(3)]
    change *= 100 / np.maximum(background, DARKEST)
    if (strength(change) > 3 * UNCHANGED).mean() > EVERYWHERE:
        raise UserError(
            "its colours differ from its background's almost everywhere: it is of another sensor or light, torn, or "
            "its background is not of the untouched gel"
        )
    return change


def changed(change: Float[np.ndarray, "rows columns 3"]) -> Bool[np.ndarray, "rows columns"]:
    """Return the mask of the pixels whose colour changed, extended by a margin."""
    smooth = ndimage.gaussian_filter(strength(change), 1.0, truncate=2.0)
    spread: Bool[np.ndarray, "rows columns"] = ndimage.maximum_filter(smooth, 2 * MARGIN + 1) > UNCHANGED
    return spread


def strength(change: Float[np.ndarray, "rows columns 3"]) -> Float[np.ndarray, "rows columns"]:
    """Return the greatest change of the three colours at each pixel."""
    red, green, blue = (np.abs(change[..., k]) for k in range(3))  # much faster than a maximum along the last axis
    greatest: Float[np.ndarray, "rows columns"] = np.maximum(np.maximum(red, green), blue)
    return greatest


def _median(levels: np.ndarray) -> float:
    """Return the median of differences of levels, by counting them."""
    counts = np.bincount((levels + 255).ravel(), minlength=511).cumsum()
    return float(np.searchsorted(counts, levels.size / 2)) - 255


def check_exposure(image: Image, what: str) -> None:
    """Check that an image is neither black nor saturated.

    Args:
        image: the image.
        what: what it is, for the message: "it", "its background".

    Raises:
        UserError: it is.
    """
    if image.mean() < BLACK:
        raise UserError(f"{what} is black, at a mean level of {image.mean():.1f} of 255: was the light on?")
    share = ((image[..., 0] == 255) | (image[..., 1] == 255) | (image[..., 2] == 255)).mean()
    if share > SATURATED:
        raise UserError(f"{what} is saturated at {share:.0%} of its pixels: lower the exposure or the light")
