"""The layout `pterotactyl`: grasps of Active-3D-Vision-and-Touch (Smith et al., 2021), a folder for each object.

`<action>/<finger>_points.npy` holds the touched points of a finger, in the object's frame and in metres, and the
pickled file `<action>/<finger>_ref_frame.npy` holds the pose of its camera.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.recorded.fields import LayoutOptions
from pcsr.recorded.layouts.arrays import METRE, in_order, joined, numbers
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.recorded.pose import check_matrix, in_object, offset_z, rotation_from


class Options(LayoutOptions):
    """Options of this layout in the manifest."""

    per: Literal["grasp", "finger"] = "grasp"
    """One touch for each grasp, with all of its fingers, or one for each finger."""
    face: Annotated[float, Field(ge=0)] = 12.8
    """Distance from a finger's camera to its face, in mm. The default is the value of the simulator's collision box."""


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Read each grasp or finger, in the object's frame, whose unit is the metre.

    Raises:
        UserError: the folder holds no action.
    """
    actions = in_order({path.parent for path in folder.glob("*/*_ref_frame.npy")})
    if not actions:
        raise UserError(
            f"{folder} holds no <action>/<finger>_ref_frame.npy: give the folder of one object, grasp_info/<id>"
        )
    for action in actions:
        yield from joined(action.name, partial(_fingers, action, options.face), options.per)


def _fingers(action: Path, face: float) -> list[Touch | None]:
    frames = sorted(action.glob("*_ref_frame.npy"))
    return [_finger(path, path.with_name(path.name.replace("_ref_frame", "_points")), face) for path in frames]


def _finger(frame: Path, points: Path, face: float) -> Touch | None:
    if not points.is_file():
        return None
    touched = numbers(load_numpy(points), (None, 3), str(points))
    if len(touched) == 0:
        return None
    recorded = load_numpy(frame)
    if not isinstance(recorded, dict) or not {"pos", "rot"} <= recorded.keys():
        raise UserError(f"{frame} has no pos and rot: it is not a frame of this layout")
    rigid = np.eye(4)
    rigid[:3, :3] = numbers(recorded["rot"], (3, 3), f"{frame}: rot")
    rigid[:3, 3] = numbers(recorded["pos"], (3,), f"{frame}: pos")
    pose = in_object(check_matrix(rigid, 1.0, f"{frame}: rot"), METRE, METRE) @ rotation_from("+x") @ offset_z(-face)
    return Touch.single(touched, pose, METRE, "smith-2021")
