"""The layout `ycb-slide`: slides of a DIGIT over YCB objects (Suresh et al., 2022), simulated or real, a folder each.

Height images are grey images with 0.03 mm per level; level 0 is 22 mm from the camera, and higher levels are closer.
A real slide has camera images only, so that height images of them are needed.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field, model_validator

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.recorded.fields import LayoutOptions
from pcsr.recorded.gel_images import touching
from pcsr.recorded.images import depth_contact, read_image, same_size
from pcsr.recorded.layouts.arrays import METRE, numbers
from pcsr.recorded.manifest import Intrinsics
from pcsr.recorded.pickles.unpickle import load_numpy, load_pickle
from pcsr.recorded.pose import check_matrix, in_object, offset_z, pose_from_7_vector, transformed

FACE = 22.0
"""Distance from the camera to the gel's face, in mm."""
LEVEL = 0.03
"""Height of one level of the height images, in mm."""
HALF_VIEW = math.radians(30)
"""Half the camera's vertical field of view, in radians."""
INERT = ("omegaconf", "dill", "typing")
"""Packages whose classes occur in the noise settings of simulated files. These objects are read but not used."""
FRAME = "frame_{:07d}.jpg"


class Options(LayoutOptions):
    """Options of this layout in the manifest."""

    kind: Literal["simulated", "real"]
    poses: Literal["camera", "measured"] | None = None
    """Simulated slides only: the exact poses (default), or those with the noise of a measurement."""
    every: Annotated[int, Field(ge=1)] = 1
    """Step between the frames that are read; 1 reads every frame."""
    heights: str | None = None
    """Real slides only: folder of the height images, which have the names of the frames."""
    masks: str | None = None
    """Real slides only: folder of the masks of contact, images that are white where the object touches the gel."""
    contact_above: Annotated[float, Field(ge=0)] | None = None
    """Real slides without masks only: height above the background from which a pixel is in contact, in mm.

    None: `pcsr.sensors.contact` finds the contact in the heights above the background.
    """
    background: str | None = None
    """Real slides only: height image of the untouched gel, which is subtracted to find the contact."""
    alignment: str | None = None
    """Real slides only: file of a 4x4 matrix whose translation, in metres, is added to all poses.

    It lies in the folder, or in the one above, as in the data set.
    """

    @model_validator(mode="after")
    def _real_only(self) -> "Options":
        keys = ("heights", "masks", "contact_above", "background", "alignment")
        given = [key for key in keys if getattr(self, key) is not None]
        if self.kind == "simulated" and given:
            raise ValueError(f"a simulated slide has its own heights and masks: leave out {', '.join(given)}")
        if self.kind == "real" and self.poses is not None:
            raise ValueError("poses chooses between those of a simulated slide: leave it out")
        if self.kind == "real" and self.heights is None:
            raise ValueError(
                "a real slide holds camera images: make height images of them and give their folder as heights, or "
                "calibrate the sensor (pcsr sensor calibrate) and record the frames as entries with the key image"
            )
        if self.masks is not None and (self.contact_above is not None or self.background is not None):
            raise ValueError("masks show the contact: leave out contact_above and background")
        if self.kind == "real" and self.masks is None and self.contact_above is None and self.background is None:
            raise ValueError("the contact of a real slide is unknown: give masks or background")
        return self

    @property
    def known_pose_error(self) -> PoseError | None:
        """The noise of measured poses: 0.5 mm along and 1 degree about each axis."""
        return PoseError(0.5, 1.0) if self.poses == "measured" else None


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Read the frames, in the object's frame, whose unit is the metre.

    Raises:
        UserError: the file of poses is missing or damaged.
    """
    simulated = options.kind == "simulated"
    poses = (
        _simulated_poses(folder, measured=options.poses == "measured")
        if simulated
        else _real_poses(folder, options.alignment)
    )
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
    placed = in_object(pose(), METRE, METRE)
    return Touch.single(transformed(placed, touched), placed, METRE, "digit", area)


def _contact(folder: Path, name: str, heights: Float[np.ndarray, "h w"], options: Options) -> Bool[np.ndarray, "h w"]:
    if options.masks is not None or options.kind == "simulated":
        mask = read_image(inside(folder, f"{options.masks or 'gt_contactmasks'}/{name}"))
        same_size(heights, mask, "mask")
        white: Bool[np.ndarray, "h w"] = mask > 127  # JPEG leaves grey along the edges
        return white
    background = np.zeros_like(heights)
    if options.background is not None:
        background = read_image(inside(folder, options.background))
        same_size(heights, background, "background")
    return touching((heights - background) * LEVEL, options.contact_above)


def _simulated_poses(folder: Path, *, measured: bool) -> list[Callable[[], Float[np.ndarray, "4 4"]]]:
    """Return the poses of the face in metres: from the exact ones of the camera, or those with noise of the face."""
    path = folder / "tactile_data.pkl"
    key, face = ("gelposes_meas", np.eye(4)) if measured else ("camposes", offset_z(-FACE / METRE))
    poses = numbers(_item(load_pickle(path, INERT), key, str(path)), (None, 7), f"{path}: {key}", finite=False)
    return [partial(_at_face, row, face, f"{path}: a pose") for row in poses]


def _at_face(row: Float[np.ndarray, "7"], face: Float[np.ndarray, "4 4"], name: str) -> Float[np.ndarray, "4 4"]:
    pose: Float[np.ndarray, "4 4"] = pose_from_7_vector(row, name) @ face
    return pose


def _real_poses(folder: Path, alignment: str | None) -> list[Callable[[], Float[np.ndarray, "4 4"]]]:
    path = folder / "synced_data.npy"
    poses = _item(load_numpy(path, INERT), "poses", str(path))
    digit = numbers(_item(poses, "DIGIT", f"{path}: poses"), (None, 7), f"{path}: poses of DIGIT", finite=False)
    others = [key for key in poses if key != "DIGIT"]
    if len(others) != 1:
        raise UserError(f"{path} holds poses of DIGIT and {others}: it needs those of DIGIT and of one object")
    tracked = numbers(poses[others[0]], (None, 7), f"{path}: poses of {others[0]}", finite=False)
    if len(tracked) != len(digit):
        raise UserError(f"{path} holds {len(digit)} poses of DIGIT and {len(tracked)} of {others[0]}")
    offset = np.zeros(3)
    if alignment is not None:
        file = inside(folder, alignment)
        file = file if file.exists() else inside(folder.resolve().parent, alignment)
        offset = check_matrix(numbers(load_numpy(file), (4, 4), str(file)), 1.0, str(file))[:3, 3]

    def relative(index: int) -> Float[np.ndarray, "4 4"]:
        of_object = pose_from_7_vector(tracked[index], f"{path}: a pose of {others[0]}")
        of_digit = pose_from_7_vector(digit[index], f"{path}: a pose of DIGIT")
        pose: Float[np.ndarray, "4 4"] = np.linalg.inv(of_object) @ of_digit
        pose[:3, 3] += offset
        at_face: Float[np.ndarray, "4 4"] = pose @ offset_z(-FACE / METRE)
        return at_face

    return [partial(relative, index) for index in range(len(digit))]


def _item(data: Any, key: str, name: str) -> Any:
    if not isinstance(data, dict) or key not in data:
        raise UserError(f"{name} has no {key}: it is not a file of this layout")
    return data[key]
