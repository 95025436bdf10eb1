"""Change of a tactile sensor's image by a touch."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from pcsr.errors import UserError
from pcsr.sensors.background import check_orientation, coarse
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
GREY = 2
"""Greatest difference of two colours of a pixel, in levels, in an image without colours."""
DRIFT = 0.08
"""Greatest median change of the colours, as a share of the background. Presses of real sensors reach 0.03."""
FEWEST_FLAT = 2
"""Least number of rows of one colour in an image that was cut off."""
EVERYWHERE = 0.7
"""Share of the image whose colour a touch can change. A change of more is of another sensor or light, or an error."""


def colour_change(image: Image, background: Image) -> Float[np.ndarray, "rows columns 3"]:
    """Compute the change of colour at each pixel in per cent of the background.

    The median over the image is taken off: it is a drift of the light, as a touch changes a part of the image only.

    Args:
        image: image of the touch.
        background: image of the untouched gel.

    Raises:
        UserError: the sizes differ, or an image is black, saturated, grey, cut off, turned, of another exposure, or
            changed almost everywhere.
    """
    if image.shape != background.shape:
        sizes = [f"{one.shape[1]} x {one.shape[0]}" for one in (image, background)]
        raise UserError(f"it has {sizes[0]} pixels, but its background {sizes[1]}: use images of one size")
    check_exposure(background, "its background")
    check_exposure(image, "it")
    _check_whole(image, background)
    rest = coarse(background)
    check_orientation(coarse(image), rest, "it", "its background")
    drift = np.array([_median(image[..., k].astype(np.int16) - background[..., k]) for k in range(3)])
    change: Float[np.ndarray, "rows columns 3"] = np.subtract(image, background, dtype=np.float64)
    change -= drift
    change *= 100 / np.maximum(background, DARKEST)
    if (strength(change) > 3 * UNCHANGED).mean() > EVERYWHERE:
        raise UserError(
            "its colours differ from its background's almost everywhere: it is of another sensor or light, torn, or "
            "its background is not of the untouched gel"
        )
    share = float(np.abs(drift).sum() / rest.mean((0, 1)).sum())
    if share > DRIFT:
        raise UserError(
            f"its light differs by {share:.0%} from its background's: fix the exposure and the white balance, and take "
            f"a background of the same time (a touch of most of the gel cannot be read)"
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
    """Check that an image has colours and is neither black nor saturated.

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
    if _is_grey(image[::8, ::8]) and _is_grey(image):  # the first is much faster
        raise UserError(f"{what} is grey: a camera image has red, green and blue: save it with its colours")


def _is_grey(image: Image) -> bool:
    red, green, blue = (image[..., k].astype(np.int16) for k in range(3))
    return bool(np.abs(red - green).max() <= GREY and np.abs(green - blue).max() <= GREY)


def _check_whole(image: Image, background: Image) -> None:
    """Check that no rows of an image are filled with one colour, as programs do with an image that was cut off.

    Raises:
        UserError: some are, and not in its background.
    """
    count = int((_flat_rows(image) & ~_flat_rows(background)).sum())
    if count >= FEWEST_FLAT:
        raise UserError(f"{count} of its {len(image)} rows have one colour: it was cut off: take it again")


def _flat_rows(image: Image) -> Bool[np.ndarray, " rows"]:
    """Return the mask of the rows that have one colour."""
    flat: Bool[np.ndarray, " rows"]
    flat = (image[:, [0, image.shape[1] // 2]] == image[:, -1:]).all(axis=(1, 2))  # the few whose other pixels count
    flat[flat] = (image[flat] == image[flat, :1]).all(axis=(1, 2))
    return flat
