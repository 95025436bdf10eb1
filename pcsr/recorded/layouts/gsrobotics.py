"""The layout `gsrobotics`: clouds saved by GelSight's program, `pc_<n>.pcd` for each frame, or `pointcloud_<n>.pcd`.

A cloud has a point for each pixel of the image: x to the right, y down, and the height, all in pixels.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pcsr.clouds.formats import read_points
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.recorded.fields import Axis, LayoutOptions, Length, NotNegative, Positive, Sign
from pcsr.recorded.gel_images import Contact, indented, levelled
from pcsr.recorded.pose import rotation_from, sensor_to_object, transformed
from pcsr.recorded.pose_models import Pose
from pcsr.sensors.foreign_heights import Integration

MOST_NAMED = 3
"""Most files without a pose that are named."""


class Options(LayoutOptions):
    """Options of this layout in the manifest."""

    mm_per_pixel: Positive
    indentation: Sign
    """Sign of the heights where an object presses into the gel."""
    contact_above: NotNegative | None = None
    """Indentation above which a pixel is in contact, in mm. None: `pcsr.sensors.contact` finds the contact."""
    integration: Integration = "gsrobotics"
    """Program that integrated the heights. Its older version did as gs_sdk does."""
    poses: dict[str, Pose]
    """Poses by the number in the file's name, or the name. The sensor's origin is the middle of the gel's face."""
    unit: Length
    """Unit of the poses."""
    object_unit: Length
    axes: Axis = "-z"
    """Axis of the poses' sensor frame along which the sensor looks."""
    sensor: str = "gelsight-mini"


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Read each cloud that has a pose, in the object's frame and unit.

    Raises:
        UserError: the folder holds no cloud.
    """
    matches = {path.name: re.fullmatch(r"(?:pc|pointcloud)_(\d+)\.pcd", path.name) for path in folder.glob("*.pcd")}
    numbers = {name: match[1] for name, match in matches.items() if match}
    if not numbers:
        raise UserError(f"{folder} holds no pc_<n>.pcd or pointcloud_<n>.pcd")
    unposed = dict(numbers)
    for key in sorted(options.poses, key=lambda text: (len(text), text)):
        files = [name for name, number in sorted(numbers.items()) if key in (name, number)]
        name = files[0] if files else key if key.endswith(".pcd") else f"pc_{key}.pcd"
        for file in files:
            unposed.pop(file, None)
        try:
            if not files:
                raise UserError(f"{folder / name} does not exist, but layout.poses.{key} is its pose: remove one")
            if len(files) > 1:
                raise UserError(f"layout.poses.{key} may be that of {' or '.join(files)}: name the file itself")
            yield name, _touch(folder / name, key, options)
        except UserError as error:
            yield name, str(error)
    if unposed:
        named = sorted(unposed, key=lambda name: (len(name), name))
        several = f"{named[0]} (and {len(named) - 1} more)" if len(named) > 1 else named[0]
        yield several, "layout.poses has no pose for the number in its name: add it, if it is a touch"


def _touch(path: Path, key: str, options: Options) -> Touch:
    pose = sensor_to_object(options.poses[key], options.unit, options.object_unit) @ rotation_from(options.axes)
    touched, area, view = _contact(read_points(path), options, path)
    return Touch.single(transformed(pose, touched), pose, options.object_unit, options.sensor, area, view)


def _contact(pixels: Float[np.ndarray, "n 3"], options: Options, path: Path) -> Contact:
    """Return the contact in pcsr's sensor frame: y up, and z above 0 where the object presses in."""
    pixels = pixels * [1, 1, 1 if options.indentation == "positive" else -1]
    image = _image(pixels)
    if image is None:
        if options.integration != "exact" or options.contact_above is None:
            raise UserError(
                f"{path}: its {len(pixels)} points are not one for each pixel of an image, so their heights cannot be "
                f'corrected: give "integration": "exact" and contact_above, if they are right'
            )
        return _above(pixels * options.mm_per_pixel, options.contact_above, options.mm_per_pixel, path)
    indentation = levelled(image * options.mm_per_pixel, options.integration)
    return indented(
        indentation,
        options.mm_per_pixel,
        options.sensor,
        contact_above=options.contact_above,
        level_known=options.integration != "exact",
    )


def _above(points: Float[np.ndarray, "n 3"], contact_above: float, mm_per_pixel: float, path: Path) -> Contact:
    """Return the points above a threshold, from those of no whole image."""
    contact = points[:, 2] > contact_above
    if not contact.any():
        raise UserError(f"{path}: no contact: none of its {len(points)} points is above {contact_above:g} mm")
    middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
    touched = (points - [*middle, 0]) * [1, -1, 1]
    return touched[contact], np.count_nonzero(contact) * mm_per_pixel**2, None


def _image(pixels: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "h w"] | None:
    """Return the heights as an image, or None unless there is one point for each pixel of a whole one."""
    if len(pixels) == 0 or not (np.isfinite(pixels[:, :2]).all() and (pixels[:, :2] % 1 == 0).all()):
        return None
    across, down = pixels[:, :2].T
    columns, rows = across.max() + 1, down.max() + 1
    if pixels[:, :2].min() < 0 or rows * columns != len(pixels):
        return None
    image = np.full((int(rows), int(columns)), np.nan)
    filled = np.zeros(image.shape, bool)
    image[down.astype(int), across.astype(int)] = pixels[:, 2]
    filled[down.astype(int), across.astype(int)] = True
    return image if filled.all() else None
