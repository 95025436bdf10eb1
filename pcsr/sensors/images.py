"""Reading of a tactile sensor's camera images."""

import warnings
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from pcsr.errors import UserError
from pcsr.inputs import read_bytes
from pcsr.limits import MOST_PIXELS

LARGEST = 1 << 28
"""Greatest size of an image file in bytes: 256 MiB."""
FORMATS = ("PNG", "JPEG", "BMP")
"""Pillow's names of the formats of camera images."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
"""Suffixes of camera images."""
COLOURED = ("RGB", "RGBA", "P")
"""Pillow's modes of images with colours."""

Image = UInt8[np.ndarray, "_ _ 3"]
"""Colour image of a camera: red, green and blue of each pixel, from 0 to 255."""


def read_rgb(path: Path | str) -> Image:
    """Read a colour image, turned as its file says (EXIF), as programs show it.

    Raises:
        UserError: the file does not exist, is damaged or cut off, is no PNG, JPEG or BMP, or has no colours.

    Examples:
        >>> from PIL import Image
        >>> Image.new("RGB", (160, 120), "teal").save("0.png")
        >>> pcsr.sensors.read_rgb("0.png").shape
        (120, 160, 3)
    """
    from PIL import ImageOps

    path = Path(path)
    mode, pixels = read_picture(path, FORMATS, lambda image: np.asarray(ImageOps.exif_transpose(image).convert("RGB")))
    if mode not in COLOURED:
        raise UserError(f"{path} is an image of mode {mode}, not of red, green and blue: save it as RGB")
    return pixels


def read_picture(path: Path, formats: Sequence[str], convert: Callable[[Any], np.ndarray]) -> tuple[str, np.ndarray]:
    """Read an image file by Pillow.

    Args:
        path: the file.
        formats: Pillow's names of the formats that are read.
        convert: returns the array of an opened image.

    Returns:
        Pillow's mode of the image, and the array.

    Raises:
        UserError: the file does not exist, is too large, damaged, cut off or of another format.
    """
    from PIL import Image as Pillow

    data = read_bytes(path, most=LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked here; other warnings are harmless
            # Only these formats: Pillow would detect fifty others, some of which start other programs.
            with Pillow.open(BytesIO(data), formats=tuple(formats)) as image:
                check_size(*image.size, path)
                return image.mode, convert(image)
    except UserError:
        raise
    except Pillow.DecompressionBombError as error:
        raise UserError(f"{path} is an image of more than {MOST_PIXELS} pixels: make it smaller") from error
    except Exception as error:  # a malformed file makes Pillow raise errors of many types
        known = f"{', '.join(formats[:-1])} or {formats[-1]}"
        raise UserError(f"{path} cannot be read as an image: it is damaged, cut off, or no {known}") from error


def check_size(width: int, height: int, path: Path) -> None:
    """Check that an image has not too many pixels.

    Raises:
        UserError: it has.
    """
    if width * height > MOST_PIXELS:
        raise UserError(f"{path} is an image of {width} x {height} pixels, more than {MOST_PIXELS}: make it smaller")
