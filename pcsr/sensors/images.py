"""Reading of a tactile sensor's camera images."""

import warnings
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from pcsr.errors import UserError
from pcsr.inputs import read_bytes
from pcsr.limits import MOST_PIXELS

LARGEST = 1 << 28
"""Greatest size of an image file in bytes: 256 MiB."""
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
    from PIL import Image as Pillow
    from PIL import ImageOps

    path = Path(path)
    data = read_bytes(path, most=LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked here; other warnings are harmless
            # Only these formats: Pillow would detect fifty others, some of which start other programs.
            with Pillow.open(BytesIO(data), formats=("PNG", "JPEG", "BMP")) as image:
                width, height = image.size
                if width * height > MOST_PIXELS:
                    raise UserError(
                        f"{path} is an image of {width} x {height} pixels, more than {MOST_PIXELS}: make it smaller"
                    )
                mode, pixels = image.mode, np.asarray(ImageOps.exif_transpose(image).convert("RGB"))
    except UserError:
        raise
    except Pillow.DecompressionBombError as error:
        raise UserError(f"{path} is an image of more than {MOST_PIXELS} pixels: make it smaller") from error
    except Exception as error:  # a malformed file makes Pillow raise errors of many types
        raise UserError(f"{path} cannot be read as an image: it is damaged, cut off, or no PNG, JPEG or BMP") from error
    if mode not in COLOURED:
        raise UserError(f"{path} is an image of mode {mode}, not of red, green and blue: save it as RGB")
    return pixels
