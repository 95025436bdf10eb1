"""The layout `smith-2020`: grasps of 3D-Vision-and-Touch (Smith et al., 2020), one pickled file each.

The files of one object, `<grasp>.npy`, hold lists with one item for each finger: the pose of its camera, whether it
is in contact, and the touched points, in the world's frame. There the object is scaled by 0.5 and lifted by 0.6 m.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.recorded.fields import LayoutOptions
from pcsr.recorded.layouts.arrays import METRE, in_order, joined, numbers
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.recorded.pose import in_object, rotation_from
from pcsr.validation_messages import shown

SCALE = 0.5
"""Length of the unit of the object's frame in the world, in metres."""
LIFT = (0.0, 0.0, 0.6)
"""Position of the object's origin in the world, in metres."""
KEYS = ("cam_pos", "cam_rot", "touch_success", "points")


class Options(LayoutOptions):
    """Options of this layout in the manifest."""

    per: Literal["grasp", "finger"] = "grasp"
    """One touch for each grasp, with all of its fingers, or one for each finger."""


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Read each grasp or finger, in the object's frame, whose unit is 500 mm.

    Raises:
        UserError: the folder holds no grasp.
    """
    files = in_order(path for path in folder.glob("*.npy") if path.is_file())
    if not files:
        raise UserError(f"{folder} holds no <grasp>.npy: give the folder of one object, scene_info/<class>/<object>")
    for path in files:
        yield from joined(path.stem, partial(_fingers, path), options.per)


def _fingers(path: Path) -> list[Touch | None]:
    grasp = load_numpy(path)
    missing = [key for key in KEYS if key not in grasp] if isinstance(grasp, dict) else list(KEYS)
    if missing:
        raise UserError(f"{path} has no {', '.join(missing)}: it is not a grasp of this layout")
    lists = [grasp[key] for key in KEYS]
    if not all(isinstance(one, list | tuple) or (isinstance(one, np.ndarray) and one.ndim) for one in lists):
        raise UserError(f"{path}: {', '.join(KEYS)} must be lists, one item for each finger")
    if len({len(one) for one in lists}) != 1:
        raise UserError(f"{path}: {', '.join(f'{len(one)} {key}' for key, one in zip(KEYS, lists, strict=True))}")
    return [
        _finger(position, angles, success, points, f"{path}: finger {number}")
        for number, (position, angles, success, points) in enumerate(zip(*lists, strict=True))
    ]


def _finger(position: Any, angles: Any, success: Any, points: Any, name: str) -> Touch | None:
    if not _truth(success, name):
        return None
    touched = numbers(points, (None, 3), f"{name}: points")
    if len(touched) == 0:
        return None
    rigid = np.eye(4)
    rigid[:3, :3] = Rotation.from_euler("xyz", numbers(angles, (3,), f"{name}: cam_rot")).as_matrix()
    rigid[:3, 3] = numbers(position, (3,), f"{name}: cam_pos") - LIFT
    pose = in_object(rigid, METRE, SCALE * METRE) @ rotation_from("+x")
    return Touch.single((touched - LIFT) / SCALE, pose, SCALE * METRE, "smith-2020")


def _truth(value: Any, name: str) -> bool:
    flag = np.asarray(value) if isinstance(value, bool | int | float | np.generic | np.ndarray) else np.zeros(0)
    if flag.size != 1 or flag.dtype.kind not in "biuf":
        raise UserError(f"{name}: touch_success must be true or false, got {shown(value)}")
    return bool(flag.item())
