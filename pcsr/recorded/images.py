"""Conversion of tactile images to contact points: height maps of a gel, and depth images of a camera behind it.

Points are in pcsr's sensor frame, in mm. Its origin is the centre of the gel's face, x points to the image's right, y
up, and z out of the object into the gel, so that an indentation has a positive z.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcsr.errors import UserError
from pcsr.recorded.likely_mistakes import check_indentation
from pcsr.recorded.manifest import Intrinsics
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.sensors.images import check_size, read_picture

SUFFIXES = (".npy", ".png", ".jpg", ".jpeg")
VIDEOS = (".avi", ".mp4", ".mov", ".mkv", ".webm")
CAMERA = "of a camera image of the gel make an entry with the key image and a calibration, see pcsr sensor calibrate"
"""Remedy for camera images, of which heights are reconstructed first."""
GREY = ("L", "I;16", "I;16B", "I;16L", "I;16N", "I")
"""Pillow's modes of images with one integer for each pixel."""


def read_image(path: Path) -> Float[np.ndarray, "h w"]:
    """Read a grey image or a two-dimensional array.

    Raises:
        UserError: the file does not exist, has an unknown suffix, is damaged, or is not grey.
    """
    suffix = path.suffix.lower()
    if suffix in VIDEOS:
        raise UserError(f"{path} is a video: save the frame of each touch as PNG, and name that")
    if suffix not in SUFFIXES:
        raise UserError(f"{path}: unknown image format '{suffix}': use one of {', '.join(SUFFIXES)}")
    image = load_numpy(path) if suffix == ".npy" else _picture(path)
    if not isinstance(image, np.ndarray) or image.ndim != 2 or image.size == 0 or image.dtype.kind not in "biuf":
        held = f"{image.dtype} of shape {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        camera = f"; {CAMERA}" if isinstance(image, np.ndarray) and image.ndim == 3 else ""
        raise UserError(f"{path} holds {held}: an image is an array of real numbers of shape (h, w){camera}")
    check_size(image.shape[1], image.shape[0], path)
    return image.astype(np.float64)


def _picture(path: Path) -> np.ndarray:
    mode, levels = read_picture(path, ("PNG", "JPEG"), np.array)
    if mode not in GREY:
        camera = f"; {CAMERA}" if mode in ("RGB", "RGBA") else ""
        raise UserError(
            f"{path} is an image of mode {mode}: heights, depths and masks must be grey, of 8 or 16 bits{camera}"
        )
    return levels


def same_size(image: np.ndarray, other: np.ndarray | None, name: str) -> None:
    """Check that a background or mask has the size of its image.

    Raises:
        UserError: the sizes differ.
    """
    if other is not None and other.shape != image.shape:
        raise UserError(f"the {name} has {other.shape} rows and columns, and the image {image.shape}: use equal sizes")


def height_contact(
    indentation: Float[np.ndarray, "h w"],
    mm_per_pixel: float,
    contact: Bool[np.ndarray, "h w"],
    sensor: str = "",
    cause: str = "correct mm_per_pixel",
) -> tuple[Float[np.ndarray, "m 3"], float]:
    """Convert a height map, seen orthographically, to contact points.

    Args:
        indentation: indentation of the gel at each pixel, in mm.
        mm_per_pixel: side of a pixel.
        contact: mask of the pixels in contact.
        sensor: name of the sensor, which may tell how thick its gel is.
        cause: likely cause of an indentation that is too large, and its remedy, for the message.

    Returns:
        The points in the sensor's frame, and the contact area in mm².

    Raises:
        UserError: no pixel is in contact, or the indentation exceeds the thickness of the gel.
    """
    rows, columns = _in_contact(contact & np.isfinite(indentation))
    check_indentation(float(indentation[rows, columns].max()), sensor, cause)
    h, w = indentation.shape
    x, y = (columns - (w - 1) / 2) * mm_per_pixel, ((h - 1) / 2 - rows) * mm_per_pixel
    return np.stack([x, y, indentation[rows, columns]], axis=-1), len(rows) * mm_per_pixel**2


def depth_contact(
    depth: Float[np.ndarray, "h w"],
    intrinsics: Intrinsics,
    face: float,
    contact: Bool[np.ndarray, "h w"],
) -> tuple[Float[np.ndarray, "m 3"], float]:
    """Convert a depth image to contact points.

    Args:
        depth: depth of each pixel along the camera's axis, in mm.
        intrinsics: intrinsics of the camera.
        face: distance of the gel's face from the camera, in mm.
        contact: mask of the pixels in contact; pixels without a finite, positive depth are ignored.

    Returns:
        The points in the sensor's frame, and the contact area, projected along the camera's axis, in mm².

    Raises:
        UserError: no pixel is in contact, or one lies farther from the face than any gel is thick.
    """
    rows, columns = _in_contact(contact & np.isfinite(depth) & (depth > 0))
    z = depth[rows, columns]
    check_indentation(face - float(z.min()), "", "correct unit or face")
    x, y = (columns - intrinsics.cx) / intrinsics.fx * z, (intrinsics.cy - rows) / intrinsics.fy * z
    area = float((z**2).sum() / (intrinsics.fx * intrinsics.fy))
    return np.stack([x, y, face - z], axis=-1), area


def _in_contact(contact: Bool[np.ndarray, "h w"]) -> tuple[np.ndarray, ...]:
    if not contact.any():
        raise UserError(f"no contact: none of the {contact.size} pixels is in contact")
    return np.nonzero(contact)
