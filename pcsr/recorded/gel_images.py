"""Contact points from the images of `height` and `depth` entries."""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcsr.files import inside
from pcsr.recorded.images import depth_contact, height_contact, read_image, same_size
from pcsr.recorded.likely_mistakes import check_coverage, check_sign, check_width
from pcsr.recorded.manifest import DepthEntry, HeightEntry
from pcsr.sensors.contact import CONTACT_SHARE, in_contact
from pcsr.sensors.foreign_heights import corrected

LEAST = 0.05
"""Indentation in mm up to which a gel counts as untouched, unless a threshold is given."""

Contact = tuple[Float[np.ndarray, "m 3"], float, tuple[float, float] | None]
"""Contact points in pcsr's sensor frame, contact area in mm², and the sides of what the sensor sees in mm.

The last is None where the gel may be curved, as one with a background, and where the object may be at pixels without
contact.
"""


def height_touch(folder: Path, entry: HeightEntry, sensor: str) -> Contact:
    """Read the contact of a height map.

    Raises:
        UserError: a file cannot be read, nothing is in contact, or the heights are likely wrong.
    """
    height = read_image(inside(folder, entry.height)) * entry.mm_per_level
    background = _optional(folder, entry.background, height, "background")
    mask = _optional(folder, entry.mask, height, "mask")
    rows, columns = height.shape
    check_width(columns, rows, entry.mm_per_pixel)
    height -= (entry.rest or 0.0) if background is None else background * entry.mm_per_level
    indentation = corrected(height, entry.integration) * (1 if entry.indentation == "positive" else -1)
    if entry.integration != "exact":
        indentation -= untouched(indentation)
    counted = indentation if mask is None else np.where(mask != 0, indentation, np.nan)
    check_sign(counted)
    contact = touching(counted, entry.contact_above)
    levelled = not (background is None and mask is None and entry.rest is None and entry.integration == "exact")
    if not levelled:
        check_coverage(contact)
    whole = background is None and mask is None and _is_all(counted, contact)
    view = (columns * entry.mm_per_pixel, rows * entry.mm_per_pixel) if whole else None
    return *height_contact(indentation, entry.mm_per_pixel, contact, sensor), view


def depth_touch(folder: Path, entry: DepthEntry, sensor: str) -> Contact:
    """Read the contact of a depth image.

    Raises:
        UserError: a file cannot be read, nothing is in contact, or the depths are likely wrong.
    """
    depth = read_image(inside(folder, entry.depth)) * entry.unit
    background = _optional(folder, entry.background, depth, "background")
    rest = entry.face if background is None else background * entry.unit
    indentation = np.where(depth > 0, rest - depth, np.nan)
    return *depth_contact(depth, entry.intrinsics, entry.face, touching(indentation, entry.contact_above), sensor), None


def touching(indentation: Float[np.ndarray, "h w"], contact_above: float | None) -> Bool[np.ndarray, "h w"]:
    """Return the pixels in contact: those above a threshold, or by the rule of `in_contact` without one.

    Args:
        indentation: indentation in mm; pixels that are not finite are not in contact.
        contact_above: threshold in mm; None for none.
    """
    if contact_above is None:
        return in_contact(indentation, at_least=LEAST)
    contact: Bool[np.ndarray, "h w"] = np.isfinite(indentation) & (indentation > contact_above)
    return contact


def untouched(indentation: Float[np.ndarray, "h w"]) -> float:
    """Return the level of the untouched gel, the median of the pixels without contact, where the level is unknown."""
    around = indentation - np.median(indentation)
    return float(np.median(indentation[~in_contact(around)]))


def _is_all(indentation: Float[np.ndarray, "h w"], contact: Bool[np.ndarray, "h w"]) -> bool:
    """Whether no pixel beside the contact is indented as deep as the rim of one: the object may touch there too."""
    beside = indentation[~contact & np.isfinite(indentation)]
    return bool(contact.any() and not (beside > CONTACT_SHARE * np.nanmax(indentation)).any())


def _optional(folder: Path, name: str | None, image: np.ndarray, role: str) -> np.ndarray | None:
    other = None if name is None else read_image(inside(folder, name))
    same_size(image, other, role)
    return other
