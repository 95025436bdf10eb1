"""The layout `gsrobotics`: clouds saved by GelSight's software, `pc_<n>.pcd`, one for each press.

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
from pcsr.recorded.fields import Axis, Length, NotNegative, Positive, Sign, Strict
from pcsr.recorded.pose import rotation_from, sensor_to_object, transformed
from pcsr.recorded.pose_models import Pose


class Options(Strict):
    """Options of this layout in the manifest."""

    mm_per_pixel: Positive
    indentation: Sign
    """Sign of the heights where an object presses into the gel."""
    contact_above: NotNegative
    """Indentation above which a pixel is in contact, in mm."""
    poses: dict[str, Pose]
    """Poses by the number in the file's name. The sensor's origin is the middle of the gel's face."""
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
    files = {match[1]: path for path in folder.glob("pc_*.pcd") if (match := re.fullmatch(r"pc_(\d+)", path.stem))}
    if not files:
        raise UserError(f"{folder} holds no pc_<n>.pcd")
    for number in sorted(files.keys() | options.poses.keys(), key=lambda text: (len(text), text)):
        name = f"pc_{number}.pcd"
        try:
            if number not in files:
                raise UserError(f"{folder / name} does not exist, but layout.poses.{number} is its pose: remove one")
            if number not in options.poses:
                raise UserError(f"layout.poses has no pose for number {number}: add it")
            yield name, _touch(files[number], number, options)
        except UserError as error:
            yield name, str(error)


def _touch(path: Path, number: str, options: Options) -> Touch:
    pose = sensor_to_object(options.poses[number], options.unit, options.object_unit) @ rotation_from(options.axes)
    touched = _contact(read_points(path), options, path)
    area = len(touched) * options.mm_per_pixel**2
    return Touch.single(transformed(pose, touched), pose, options.object_unit, options.sensor, area)


def _contact(pixels: Float[np.ndarray, "n 3"], options: Options, path: Path) -> Float[np.ndarray, "m 3"]:
    """Return the contact points in pcsr's sensor frame: y up, and z above 0 where the object presses in."""
    middle = (pixels[:, :2].min(axis=0) + pixels[:, :2].max(axis=0)) / 2
    x, down = ((pixels[:, :2] - middle) * options.mm_per_pixel).T
    z = pixels[:, 2] * options.mm_per_pixel * (1 if options.indentation == "positive" else -1)
    contact = z > options.contact_above
    if not contact.any():
        raise UserError(f"{path}: no contact: none of its {len(z)} pixels is above {options.contact_above:g} mm")
    touched: Float[np.ndarray, "m 3"] = np.stack([x, -down, z], axis=-1)[contact]
    return touched
