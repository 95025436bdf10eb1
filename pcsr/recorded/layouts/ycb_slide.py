"""The layout `ycb-slide`: DIGIT slides over YCB objects (Suresh et al., 2022), simulated or real, a folder for each.

Heights are grey images whose levels are 0.03 mm, counted from 22 mm before the camera towards it. pcsr does not
make geometry of camera images: a real slide needs such height images beside it.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field, model_validator

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.recorded.images import depth_contact, read_image, same_size
from pcsr.recorded.layouts.arrays import METRE, numbers
from pcsr.recorded.manifest import Intrinsics, Strict
from pcsr.recorded.pickles.unpickle import load_numpy, load_pickle
from pcsr.recorded.pose import check_matrix, in_object, offset_z, pose_from_7_vector, transformed

FACE = 22.0
"""From the camera to the gel's face, in mm."""
LEVEL = 0.03
"""Of the height images, in mm."""
HALF_VIEW = math.radians(30)
"""Half the camera's field of view along the image's height."""
INERT = ("omegaconf", "dill", "typing")
"""The simulated files hold a record of their noise, of classes that are nobody's data."""
FRAME = "frame_{:07d}.jpg"


class Options(Strict):
    """What the manifest says of this layout."""

    kind: Literal["simulated", "real"]
    every: Annotated[int, Field(ge=1)] = 1
    """Every so-many-th frame is a touch."""
    heights: str | None = None
    """Real slides only: folder with a height image for each frame, of the frame's name."""
    masks: str | None = None
    """Real slides only: folder with an image for each frame that is white where the object touches."""
    contact_above: Annotated[float, Field(ge=0)] | None = None
    """Real slides only, where there are no masks: heights of contact begin here, in mm above the background."""
    background: str | None = None
    """Real slides only: height image of the untouched gel, which is subtracted for `contact_above`."""
    alignment: str | None = None
    """Real slides only: file of a 4x4 matrix whose translation, in metres, is added to all touched points."""

    @model_validator(mode="after")
    def _real_only(self) -> "Options":
        keys = ("heights", "masks", "contact_above", "background", "alignment")
        given = [key for key in keys if getattr(self, key) is not None]
        if self.kind == "simulated" and given:
            raise ValueError(f"a simulated slide has its own heights and masks: leave out {', '.join(given)}")
        if self.kind == "real" and self.heights is None:
            raise ValueError(
                "a real slide holds camera images, of which pcsr makes no geometry: make height images of them "
                "with another program, and name their folder as heights"
            )
        if self.kind == "real" and (self.masks is None) == (self.contact_above is None):
            raise ValueError("say where a real slide is in contact: give one of masks and contact_above")
        if self.background is not None and self.contact_above is None:
            raise ValueError("background serves contact_above: give both")
        return self


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Each frame, in the object's frame, whose unit is the metre.

    Raises:
        UserError: the poses are not there, or are damaged.
    """
    simulated = options.kind == "simulated"
    poses = _simulated_poses(folder) if simulated else _real_poses(folder, options.alignment)
    for index in range(0, len(poses), options.every):
        name = f"{index}.jpg" if simulated else FRAME.format(index)
        try:
            yield name, _touch(folder, name, poses[index], options)
        except UserError as error:
            yield name, str(error)


def _touch(folder: Path, name: str, pose: Callable[[], Float[np.ndarray, "4 4"]], options: Options) -> Touch:
    heights = read_image(inside(folder, f"{options.heights or 'gt_heightmaps'}/{name}"))
    contact = _contact(folder, name, heights, options)
    rows, columns = heights.shape
    focal = 0.5 * rows / math.tan(HALF_VIEW)
    camera = Intrinsics(fx=focal, fy=focal, cx=columns / 2, cy=rows / 2)
    touched, area = depth_contact(FACE - heights * LEVEL, camera, FACE, contact)
    placed = in_object(pose(), METRE, METRE) @ offset_z(-FACE)
    return Touch.single(transformed(placed, touched), placed, METRE, "digit", area)


def _contact(folder: Path, name: str, heights: Float[np.ndarray, "h w"], options: Options) -> Bool[np.ndarray, "h w"]:
    if options.contact_above is None:
        mask = read_image(inside(folder, f"{options.masks or 'gt_contactmasks'}/{name}"))
        same_size(heights, mask, "mask")
        white: Bool[np.ndarray, "h w"] = mask > 127  # JPEG leaves grey along the edges
        return white
    background = np.zeros_like(heights)
    if options.background is not None:
        background = read_image(inside(folder, options.background))
        same_size(heights, background, "background")
    above: Bool[np.ndarray, "h w"] = (heights - background) * LEVEL > options.contact_above
    return above


def _simulated_poses(folder: Path) -> list[Callable[[], Float[np.ndarray, "4 4"]]]:
    path = folder / "tactile_data.pkl"
    poses = numbers(
        _item(load_pickle(path, INERT), "camposes", str(path)), (None, 7), f"{path}: camposes", finite=False
    )
    return [partial(pose_from_7_vector, row, f"{path}: a pose") for row in poses]


def _real_poses(folder: Path, alignment: str | None) -> list[Callable[[], Float[np.ndarray, "4 4"]]]:
    path = folder / "synced_data.npy"
    poses = _item(load_numpy(path, INERT), "poses", str(path))
    digit = numbers(_item(poses, "DIGIT", f"{path}: poses"), (None, 7), f"{path}: poses of DIGIT", finite=False)
    others = [key for key in poses if key != "DIGIT"]
    if len(others) != 1:
        raise UserError(f"{path} holds poses of DIGIT and {others}: they must be of DIGIT and one object")
    thing = numbers(poses[others[0]], (None, 7), f"{path}: poses of {others[0]}", finite=False)
    if len(thing) != len(digit):
        raise UserError(f"{path} holds {len(digit)} poses of DIGIT and {len(thing)} of {others[0]}")
    moved = np.zeros(3)
    if alignment is not None:
        file = inside(folder, alignment)
        moved = check_matrix(numbers(load_numpy(file), (4, 4), str(file)), 1.0, str(file))[:3, 3]

    def relative(index: int) -> Float[np.ndarray, "4 4"]:
        of_object = pose_from_7_vector(thing[index], f"{path}: a pose of {others[0]}")
        of_digit = pose_from_7_vector(digit[index], f"{path}: a pose of DIGIT")
        pose: Float[np.ndarray, "4 4"] = np.linalg.inv(of_object) @ of_digit
        pose[:3, 3] += moved
        return pose

    return [partial(relative, index) for index in range(len(digit))]


def _item(data: Any, key: str, name: str) -> Any:
    if not isinstance(data, dict) or key not in data:
        raise UserError(f"{name} has no {key}: it is no file of this layout")
    return data[key]
