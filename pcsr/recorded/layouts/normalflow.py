"""The layout `normalflow`: trials of a GelSight sensor that is tracked over an object (Huang et al., 2024).

`gradient_maps.npy` holds the slopes of the gel in each frame, `contact_masks.npy` the masks of contact, and
`*_start_T_currs.npy` the sensor's motion since the first frame, in metres, by a tracker or by motion capture. The
sensor frame of this layout has x to the right of the image, y down and z into the object. Heights are negative where an
object presses into the gel.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field
from scipy import ndimage

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.inputs import check_file
from pcsr.limits import MOST_PIXELS
from pcsr.recorded.fields import LayoutOptions, Length, Positive
from pcsr.recorded.images import height_contact
from pcsr.recorded.layouts.arrays import METRE
from pcsr.recorded.pose import check_matrix, rotation_from, sensor_to_object, transformed
from pcsr.recorded.pose_models import Pose
from pcsr.sensors.gels import check_width
from pcsr.sensors.integration import integrated

MEASURED = "true_start_T_currs.npy"
"""File of the motions that a motion capture measured; others are tracked in the images."""
FEWEST_SHARED = 10
"""Fewest pixels that must be in contact both in the first frame and in a later one, as in the tracker."""

Surface = tuple[Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]
"""Height of each pixel above the face of the untouched gel in mm, along z, and the pixels in contact."""


class Options(LayoutOptions):
    """Options of this layout in the manifest."""

    mm_per_pixel: Positive
    start: Pose
    """Pose of the sensor frame of this layout in the first frame; its origin lies on the face of the untouched gel."""
    unit: Length
    """Unit of `start`."""
    object_unit: Length
    poses: str | None = None
    """File of the motions. It is needed only if the folder holds several."""
    sensor: str = "gelsight-mini"
    every: Annotated[int, Field(ge=1)] = 1
    """Step between the frames that are read; 1 reads every frame."""


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Read the frames, in the object's frame and unit.

    Raises:
        UserError: a file is missing or damaged, or the shapes of the files do not agree.
    """
    gradients = _mapped(folder / "gradient_maps.npy", "(n, h, w, 2)", 4)
    masks = _mapped(folder / "contact_masks.npy", "(n, h, w)", 3)
    path = _poses(folder, options.poses)
    motions = _mapped(path, "(n, 4, 4)", 3)
    shapes = gradients.shape, masks.shape, motions.shape
    if masks.shape[1] * masks.shape[2] > MOST_PIXELS:
        raise UserError(f"{folder}: its frames have shape {masks.shape[1:]}, more than {MOST_PIXELS} pixels")
    if not gradients.size:
        raise UserError(f"{folder}: gradient_maps.npy of shape {gradients.shape} is empty")
    if gradients.shape[3] != 2 or masks.shape != gradients.shape[:3] or motions.shape != (len(masks), 4, 4):
        raise UserError(f"{folder}: gradients, masks and poses of shapes {shapes} do not fit together")
    check_width(masks.shape[2], masks.shape[1], options.mm_per_pixel)
    if len(masks) == 0:
        raise UserError(f"{folder}: the trial has no frame")
    start = sensor_to_object(options.start, options.unit, options.object_unit)
    first = None if path.name == MEASURED else _surface(gradients[0], masks[0], options.mm_per_pixel)
    for index in range(0, len(masks), options.every):
        name = f"frame {index}"
        try:
            motion = check_matrix(np.array(motions[index], np.float64), 1.0, f"{path}: pose {index}")
            motion[:3, 3] *= METRE
            height, contact = surface = _surface(gradients[index], masks[index], options.mm_per_pixel)
            touched, area = height_contact(-height, options.mm_per_pixel, contact, options.sensor)
            if first is not None and index > 0:
                motion = _with_exact_z(motion, first, surface, options.mm_per_pixel)
            pose = start @ motion @ rotation_from("+z")
            points = transformed(pose, touched)
            yield name, Touch.single(points, pose, options.object_unit, options.sensor, area)
        except UserError as error:
            yield name, str(error)


def _surface(gradients: Float[np.ndarray, "h w 2"], mask: np.ndarray, mm_per_pixel: float) -> Surface:
    """Integrate the slopes of a frame; the gel's face is taken as the median of the pixels without contact."""
    slopes = np.asarray(gradients, np.float64)
    if not np.isfinite(slopes).all():
        raise UserError("a slope in gradient_maps.npy is not finite")
    height = integrated(slopes) * mm_per_pixel
    contact: Bool[np.ndarray, "h w"] = mask != 0
    return height - (height.max() if contact.all() else np.median(height[~contact])), contact


def _with_exact_z(
    motion: Float[np.ndarray, "4 4"], first: Surface, surface: Surface, mm_per_pixel: float
) -> Float[np.ndarray, "4 4"]:
    """Return a tracked motion with its z determined again, from exact heights.

    NormalFlow finds the rotation and x and y from normals, and then z as the mean difference of the heights of both
    frames where both are in contact. Its heights are those of gs_sdk, which are 1.3 to 1.5 times too high and have no
    common level.
    """
    height, contact = first
    h, w = height.shape
    v, u = np.nonzero(contact)
    back = np.linalg.inv(motion)  # from the first frame to this one
    back[2, 3] = 0
    points = np.stack([(u - (w - 1) / 2) * mm_per_pixel, (v - (h - 1) / 2) * mm_per_pixel, height[contact]], axis=-1)
    x, y, z = transformed(back, points).T
    places = np.stack([y / mm_per_pixel + (h - 1) / 2, x / mm_per_pixel + (w - 1) / 2])
    both = ndimage.map_coordinates(surface[1].astype(np.float64), places, order=1) > 0.5
    if np.count_nonzero(both) < FEWEST_SHARED:
        return motion
    back[2, 3] = float((ndimage.map_coordinates(surface[0], places[:, both], order=1) - z[both]).mean())
    again: Float[np.ndarray, "4 4"] = np.linalg.inv(back)
    return again


def _poses(folder: Path, name: str | None) -> Path:
    if name is not None:
        return inside(folder, name)
    found = sorted(folder.glob("*_start_T_currs.npy"))
    if len(found) != 1:
        names = ", ".join(path.name for path in found)
        raise UserError(
            f"{folder} holds {len(found)} files *_start_T_currs.npy{f' ({names})' if names else ''}: "
            f"name one as poses in the layout"
        )
    return found[0]


def _mapped(path: Path, shape: str, dimensions: int) -> np.ndarray:
    """Return an array that is mapped into memory and read on demand."""
    check_file(path)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy raises whatever a malformed header makes it trip over
        raise UserError(f"{path} cannot be read as an .npy file of numbers: it is damaged or cut off") from error
    if not isinstance(array, np.ndarray) or array.ndim != dimensions or array.dtype.kind not in "biuf":
        raise UserError(f"{path} must hold numbers of shape {shape}")
    return array
