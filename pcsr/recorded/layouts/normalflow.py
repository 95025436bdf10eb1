"""The layout `normalflow`: trials of a GelSight sensor that is tracked over an object (Huang et al., 2024).

`gradient_maps.npy` holds the slopes of the gel in each frame, `contact_masks.npy` where it is in contact, and
`*_start_T_currs.npy` the sensor's motion since the first frame, in metres. The sensor's frame there has x to the
image's right, y down and z into the object; what presses in has heights below 0.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field
from scipy import fft

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.inputs import check_file
from pcsr.limits import MOST_PIXELS
from pcsr.recorded.images import height_contact
from pcsr.recorded.layouts.arrays import METRE
from pcsr.recorded.manifest import Length, Pose, Positive, Strict
from pcsr.recorded.pose import check_matrix, offset_z, rotation_from, sensor_to_object, transformed


class Options(Strict):
    """What the manifest says of this layout."""

    mm_per_pixel: Positive
    start: Pose
    """Of the first frame: from the sensor's frame as the trial has it, its origin on the untouched gel's face."""
    unit: Length
    """Of `start`."""
    object_unit: Length
    poses: str | None = None
    """The file of motions, where there is more than one."""
    sensor: str = "gelsight-mini"
    every: Annotated[int, Field(ge=1)] = 1
    """Every so-many-th frame is a touch."""


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Each frame, in the object's frame and unit.

    Raises:
        UserError: a file is not there, or damaged, or they do not fit together.
    """
    gradients = _mapped(folder / "gradient_maps.npy", "(n, h, w, 2)", 4)
    masks = _mapped(folder / "contact_masks.npy", "(n, h, w)", 3)
    path = _poses(folder, options.poses)
    motions = _mapped(path, "(n, 4, 4)", 3)
    shapes = gradients.shape, masks.shape, motions.shape
    if masks.shape[1] * masks.shape[2] > MOST_PIXELS:
        raise UserError(f"{folder}: its frames have shape {masks.shape[1:]}, and {MOST_PIXELS} pixels are the most")
    if not gradients.size:
        raise UserError(f"{folder}: gradient_maps.npy of shape {gradients.shape} holds nothing")
    if gradients.shape[3] != 2 or masks.shape != gradients.shape[:3] or motions.shape != (len(masks), 4, 4):
        raise UserError(f"{folder}: gradients, masks and poses of shapes {shapes} do not fit together")
    if len(masks) == 0:
        raise UserError(f"{folder}: the trial has no frame")
    # Heights are known up to a constant, which is another in each frame; the motions are of surfaces whose
    # heights are 0 on average. So each frame's origin is moved from that average to the gel's face.
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


def integrated(gradients: Float[np.ndarray, "h w 2"]) -> Float[np.ndarray, "h w"]:
    """The surface whose slopes are nearest to `gradients`, by least squares; 0 on average.

    The step between two pixels is the mean of their slopes. The normal equations of all steps are a Poisson
    equation with free edges, which the cosine transform solves pixel by pixel.

    Args:
        gradients: along x (columns) and y (rows), in height for each pixel.
    """
    h, w = gradients.shape[:2]
    across = (gradients[:, 1:, 0] + gradients[:, :-1, 0]) / 2
    down = (gradients[1:, :, 1] + gradients[:-1, :, 1]) / 2
    right = -np.diff(np.pad(across, ((0, 0), (1, 1))), axis=1) - np.diff(np.pad(down, ((1, 1), (0, 0))), axis=0)
    waves = 2 - 2 * np.cos(np.pi * np.arange(h) / h)[:, None] + 2 - 2 * np.cos(np.pi * np.arange(w) / w)
    waves[0, 0] = 1  # the average, which no slope tells
    spectrum = fft.dctn(right, norm="ortho") / waves
    spectrum[0, 0] = 0
    surface: Float[np.ndarray, "h w"] = fft.idctn(spectrum, norm="ortho")
    return surface


def _surface(
    gradients: Float[np.ndarray, "h w 2"], mask: np.ndarray, mm_per_pixel: float
) -> tuple[Float[np.ndarray, "h w"], float]:
    """A frame's heights in mm, and that of the gel's face among them: the median where nothing touches."""
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
    """An array that stays in its file until it is looked at."""
    check_file(path)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy raises whatever a malformed header makes it trip over
        raise UserError(f"{path} cannot be read as an .npy file of numbers: it is damaged or cut off") from error
    if not isinstance(array, np.ndarray) or array.ndim != dimensions or array.dtype.kind not in "biuf":
        raise UserError(f"{path} must hold numbers of shape {shape}")
    return array
