"""Contact points from the images of `height` and `depth` entries."""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcsr.files import inside
from pcsr.recorded.images import depth_contact, height_contact, read_image, same_size
from pcsr.recorded.likely_mistakes import check_coverage, check_indentation, check_sign
from pcsr.recorded.manifest import DepthEntry, HeightEntry
from pcsr.sensors.contact import CONTACT_SHARE, in_contact
from pcsr.sensors.foreign_heights import Integration, corrected
from pcsr.sensors.gels import check_width

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
    height -= (entry.rest or 0.0) if background is None else background * entry.mm_per_level
    indentation = levelled(height if entry.indentation == "positive" else -height, entry.integration)
    known = not (background is None and entry.rest is None and entry.integration == "exact")
    points, area, view = indented(
        indentation,
        entry.mm_per_pixel,
        sensor,
        contact_above=entry.contact_above,
        mask=mask,
        level_known=known,
        cause=f"heights in pixels take mm_per_level {entry.mm_per_pixel:g}, the mm_per_pixel; correct mm_per_level or "
        f"rest",
    )
    return points, area, view if background is None else None


def levelled(indentation: Float[np.ndarray, "h w"], integration: Integration) -> Float[np.ndarray, "h w"]:
    """Correct indentations for the integration of a program, and measure them from the untouched gel.

    That is taken as the median of the pixels without contact. Indentations that are exact stay as they are.
    """
    if integration == "exact":
        return indentation
    to_scale = corrected(indentation, integration)
    contact = in_contact(to_scale - np.median(to_scale))
    measured: Float[np.ndarray, "h w"] = to_scale - np.median(to_scale[~contact])
    return measured


def indented(
    indentation: Float[np.ndarray, "h w"],
    mm_per_pixel: float,
    sensor: str,
    *,
    contact_above: float | None = None,
    mask: np.ndarray | None = None,
    level_known: bool = True,
    cause: str = "correct mm_per_pixel",
) -> Contact:
    """Return the contact of a gel that is indented so far.

    Args:
        indentation: indentation at each pixel, in mm.
        mm_per_pixel: side of a pixel.
        sensor: name of the sensor.
        contact_above: threshold in mm; None for the rule of `touching`.
        mask: image that is 0 where pixels do not count.
        level_known: whether the indentation is known to be 0 where the gel is untouched.
        cause: likely cause of an indentation that is too large, and its remedy, for the message.

    Raises:
        UserError: nothing is in contact, or the indentation is likely wrong.
    """
    rows, columns = indentation.shape
    check_width(columns, rows, mm_per_pixel)
    counted = indentation if mask is None else np.where(mask != 0, indentation, np.nan)
    check_sign(counted)
    contact = touching(counted, contact_above)
    if mask is None and not level_known:
        check_coverage(contact)
    points, area = height_contact(indentation, mm_per_pixel, contact, sensor, cause)
    whole = mask is None and _is_all(indentation, contact)
    return points, area, (columns * mm_per_pixel, rows * mm_per_pixel) if whole else None


def depth_touch(folder: Path, entry: DepthEntry, sensor: str) -> Contact:
    """Read the contact of a depth image.

    Raises:
        UserError: a file cannot be read, nothing is in contact, or the depths are likely wrong.
    """
    depth = read_image(inside(folder, entry.depth)) * entry.unit
    background = _optional(folder, entry.background, depth, "background")
    rest = entry.face if background is None else background * entry.unit
    indentation = np.where(depth > 0, rest - depth, np.nan)
    contact = touching(indentation, entry.contact_above)
    points, area = depth_contact(depth, entry.intrinsics, entry.face, contact)
    if background is not None:  # without one a curved gel is farther from the plane of the face than it is indented
        check_indentation(float(indentation[contact].max()), sensor, "correct unit or background")
    return points, area, None


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


def _is_all(indentation: Float[np.ndarray, "h w"], contact: Bool[np.ndarray, "h w"]) -> bool:
    """Whether no pixel beside the contact is indented as deep as the rim of one: the object may touch there too."""
    beside = indentation[~contact & np.isfinite(indentation)]
    return bool(contact.any() and not (beside > CONTACT_SHARE * np.nanmax(indentation)).any())


def _optional(folder: Path, name: str | None, image: np.ndarray, role: str) -> np.ndarray | None:
    other = None if name is None else read_image(inside(folder, name))
    same_size(image, other, role)
    return other
