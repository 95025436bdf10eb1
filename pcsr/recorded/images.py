"""Images of a gel: how far it was pressed in, or how far a camera behind it sees. To points in the sensor's frame.

The sensor's frame is pcsr's: in mm, its origin in the middle of the gel's face, x to the image's right, y up,
and z out of the object: what presses in has z above 0.
"""

import warnings
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcsr.errors import UserError
from pcsr.inputs import read_bytes
from pcsr.limits import MOST_PIXELS
from pcsr.recorded.manifest import Intrinsics
from pcsr.recorded.pickles.unpickle import load_numpy

SUFFIXES = (".npy", ".png", ".jpg", ".jpeg")
LARGEST = 1 << 28
"""Bytes of the largest image file: 256 MiB, more than `MOST_PIXELS` doubles take."""
THICKEST = 30.0
"""No fingertip's gel gives way farther, in mm."""
GREY = ("L", "I;16", "I;16B", "I;16L", "I;16N", "I")
"""Pillow's names of images with one whole number a pixel."""


def read_image(path: Path) -> Float[np.ndarray, "h w"]:
    """The levels of a grey image, or a two-dimensional array.

    Raises:
        UserError: no such file, an unknown suffix, a damaged file, or one that is not grey.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise UserError(f"{path}: no image format '{suffix}': {', '.join(SUFFIXES)} are known")
    image = load_numpy(path) if suffix == ".npy" else _picture(path)
    if not isinstance(image, np.ndarray) or image.ndim != 2 or image.size == 0 or image.dtype.kind not in "biuf":
        held = f"{image.dtype} of shape {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise UserError(f"{path} holds {held}: an image is an array of real numbers of shape (h, w)")
    _check_size(image.shape[1], image.shape[0], path)
    return image.astype(np.float64)


def _check_size(width: int, height: int, path: Path) -> None:
    if width * height > MOST_PIXELS:
        raise UserError(
            f"{path} is an image of {width} x {height} pixels, and {MOST_PIXELS} are the most: make it smaller"
        )


def _picture(path: Path) -> np.ndarray:
    from PIL import Image, UnidentifiedImageError

    data = read_bytes(path, most=LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its size is looked at here, and what else it finds odd does no harm
            # Of these kinds alone: Pillow knows fifty more by their content, some of which start other programs.
            with Image.open(BytesIO(data), formats=("PNG", "JPEG")) as image:
                _check_size(*image.size, path)
                mode, levels = image.mode, np.array(image)
    except UserError:
        raise
    except Image.DecompressionBombError as error:
        raise UserError(f"{path} is an image of more than {MOST_PIXELS} pixels, the most: make it smaller") from error
    except Exception as error:  # Pillow raises whatever a malformed file makes it trip over
        reason = "it is damaged, or no PNG or JPEG" if isinstance(error, UnidentifiedImageError) else error
        raise UserError(f"{path} cannot be read as an image: {reason}") from error
    if mode not in GREY:
        raise UserError(f"{path} is an image of mode {mode}: heights, depths and masks are grey, of 8 or 16 bits")
    return levels


def same_size(image: np.ndarray, other: np.ndarray | None, name: str) -> None:
    """Refuse a background or mask that does not fit.

    Raises:
        UserError: it has another size.
    """
    if other is not None and other.shape != image.shape:
        raise UserError(f"the {name} has {other.shape} rows and columns, and the image {image.shape}")


def height_contact(
    indentation: Float[np.ndarray, "h w"], mm_per_pixel: float, contact: Bool[np.ndarray, "h w"]
) -> tuple[Float[np.ndarray, "m 3"], float]:
    """The points in contact, in the sensor's frame, and their area in mm²; pixels are looked at from straight above.

    Args:
        indentation: how far each pixel of the gel is pressed in, in mm.
        mm_per_pixel: side of a pixel.
        contact: where the object touches.

    Raises:
        UserError: no pixel is in contact.
    """
    rows, columns = _in_contact(contact & np.isfinite(indentation))
    _check_depth(float(indentation[rows, columns].max()))
    h, w = indentation.shape
    x, y = (columns - (w - 1) / 2) * mm_per_pixel, ((h - 1) / 2 - rows) * mm_per_pixel
    return np.stack([x, y, indentation[rows, columns]], axis=-1), len(rows) * mm_per_pixel**2


def depth_contact(
    depth: Float[np.ndarray, "h w"], intrinsics: Intrinsics, face: float, contact: Bool[np.ndarray, "h w"]
) -> tuple[Float[np.ndarray, "m 3"], float]:
    """The points in contact, in the sensor's frame, and their area across the camera's axis in mm².

    Args:
        depth: of each pixel along the camera's axis, in mm.
        intrinsics: of the camera.
        face: distance of the gel's face from the camera, in mm.
        contact: where the object touches; pixels without a depth are none.

    Raises:
        UserError: no pixel is in contact.
    """
    rows, columns = _in_contact(contact & np.isfinite(depth) & (depth > 0))
    z = depth[rows, columns]
    _check_depth(face - float(z.min()))
    x, y = (columns - intrinsics.cx) / intrinsics.fx * z, (intrinsics.cy - rows) / intrinsics.fy * z
    area = float((z**2).sum() / (intrinsics.fx * intrinsics.fy))
    return np.stack([x, y, face - z], axis=-1), area


def _check_depth(most: float) -> None:
    """Refuse what no gel can be: most often a wrong unit.

    Raises:
        UserError: it is pressed in too far.
    """
    if most > THICKEST:
        raise UserError(
            f"the gel is pressed in by {most:.4g} mm, and none is thicker than {THICKEST:g} mm: check its unit, "
            f"mm_per_level or face"
        )


def _in_contact(contact: Bool[np.ndarray, "h w"]) -> tuple[np.ndarray, ...]:
    if not contact.any():
        raise UserError(f"no contact: none of its {contact.size} pixels is in contact")
    return np.nonzero(contact)
