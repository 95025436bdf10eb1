"""The layout `normalflow`: trials of a GelSight sensor that is tracked over an object (Huang et al., 2024).

`gradient_maps.npy` holds the slopes of the gel in each frame, `contact_masks.npy` the masks of contact, and
`*_start_T_currs.npy` the sensor's motion since the first frame, in metres. The sensor frame of this layout has x to
the right of the image, y down and z into the object. Heights are negative where an object presses into the gel.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.inputs import check_file
from pcsr.limits import MOST_PIXELS
from pcsr.recorded.images import height_contact
from pcsr.recorded.layouts.arrays import METRE
from pcsr.recorded.manifest import Length, Pose, Positive, Strict
from pcsr.recorded.pose import check_matrix, offset_z, rotation_from, sensor_to_object, transformed
from pcsr.sensors.integration import integrated


class Options(Strict):
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
    if len(masks) == 0:
        raise UserError(f"{folder}: the trial has no frame")
    # Integrated heights are known up to a constant, which differs between frames, and the motions refer to surfaces
    # of mean height 0. Each frame's origin is therefore moved from the mean height to the gel's face.
    first_face = _surface(gradients[0], masks[0], options.mm_per_pixel)[1]
    start = sensor_to_object(options.start, options.unit, options.object_unit) @ offset_z(-first_face)
    for index in range(0, len(masks), options.every):
        name = f"frame {index}"
        try:
            motion = check_matrix(np.array(motions[index], np.float64), 1.0, f"{path}: pose {index}")
            motion[:3, 3] *= METRE
            height, face = _surface(gradients[index], masks[index], options.mm_per_pixel)
            touched, area = height_contact(face - height, options.mm_per_pixel, masks[index] != 0)
            pose = start @ motion @ offset_z(face) @ rotation_from("+z")
            points = transformed(pose, touched)
            yield name, Touch.single(points, pose, options.object_unit, options.sensor, area)
        except UserError as error:
            yield name, str(error)


def _surface(
    gradients: Float[np.ndarray, "h w 2"], mask: np.ndarray, mm_per_pixel: float
) -> tuple[Float[np.ndarray, "h w"], float]:
    """Return a frame's heights and the height of the gel's face, the median of pixels without contact, in mm."""
    slopes = np.asarray(gradients, np.float64)
    if not np.isfinite(slopes).all():
        raise UserError("a slope in gradient_maps.npy is not finite")
    height = integrated(slopes) * mm_per_pixel
    free: Bool[np.ndarray, "h w"] = mask == 0
    return height, float(np.median(height[free]) if free.any() else height.max())


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
