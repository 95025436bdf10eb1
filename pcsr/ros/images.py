"""Images of messages sensor_msgs/Image and CompressedImage, and intrinsics of sensor_msgs/CameraInfo."""

import warnings
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import Float64, UInt8

from pcsr.errors import UserError
from pcsr.limits import MOST_PIXELS

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
COLOURS = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0)}
"""Encodings of images in colour, and the channels that are red, green and blue."""
DEPTHS = {"32FC1": ("f4", 1000.0), "16UC1": ("u2", 1.0)}
"""Encodings of depth images: NumPy's type, and the unit in mm."""


def is_depth(message: Any) -> bool:
    """Return whether an image has depths, by its encoding; a compressed one has colours.

    Raises:
        UserError: the encoding is not supported.
    """
    encoding = getattr(message, "encoding", None)
    if encoding is None or encoding in COLOURS:
        return False
    if encoding not in DEPTHS:
        known = ", ".join([*DEPTHS, *COLOURS])
        raise UserError(f"its images have the encoding '{encoding[:80]}': {known}, PNG and JPEG are supported")
    return True


def depth(message: Any) -> Float64[np.ndarray, "h w"]:
    """Return the depths of an image in mm; NaN where there is none: 0, and what is not finite.

    Raises:
        UserError: the image is not one of depths, or is damaged.
    """
    if not is_depth(message):
        raise UserError(f"its images have the encoding '{message.encoding}', and no depths")
    kind, unit = DEPTHS[message.encoding]
    found = _pixels(message, np.dtype(">" + kind if message.is_bigendian else "<" + kind), 1)[:, :, 0]
    depths = found.astype(np.float64) * unit
    depths[~np.isfinite(depths) | (depths <= 0)] = np.nan
    return depths


def colours(message: Any) -> UInt8[np.ndarray, "h w 3"]:
    """Return the red, green and blue of an image or a compressed image.

    Raises:
        UserError: the image is not in colour, or is damaged.
    """
    if hasattr(message, "format"):
        return _decoded(message)
    if is_depth(message):
        raise UserError(f"its images have the encoding '{message.encoding}', and no colours")
    channels = list(COLOURS[message.encoding])
    return np.ascontiguousarray(_pixels(message, np.dtype(np.uint8), 3)[:, :, channels])


def intrinsics(message: Any) -> tuple[float, float, float, float]:
    """Return fx, fy, cx and cy of a camera, in pixels.

    Raises:
        UserError: they are not finite or not positive, as those of a camera that is not calibrated.
    """
    # The field is called K in ROS 1.
    matrix = np.asarray(getattr(message, "k", None) if hasattr(message, "k") else message.K, np.float64)
    fx, fy, cx, cy = matrix[[0, 4, 2, 5]].tolist()
    if not (np.isfinite(matrix).all() and fx > 0 and fy > 0):
        raise UserError(f"its intrinsics are fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}: calibrate the camera")
    return fx, fy, cx, cy


def _pixels(message: Any, kind: np.dtype[Any], channels: int) -> np.ndarray:
    """Return the pixels of an image (h, w, channels), a view of its data.

    Raises:
        UserError: the image has too many pixels, none, or more than data.
    """
    rows, columns, step, size = int(message.height), int(message.width), int(message.step), len(message.data)
    _check_size(columns, rows)
    line = columns * channels * kind.itemsize
    if step < line or (rows - 1) * step + line > size:
        raise UserError(
            f"its image of {columns} x {rows} pixels has rows of {step} bytes, and {size} bytes in all: it is damaged"
        )
    strides = (step, channels * kind.itemsize, kind.itemsize)
    return np.ndarray((rows, columns, channels), kind, message.data, strides=strides)


def _decoded(message: Any) -> UInt8[np.ndarray, "h w 3"]:
    from PIL import Image

    if "compressedDepth" in message.format:
        raise UserError(f"its images are '{message.format[:80]}': record the depth images uncompressed")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked here
            with Image.open(BytesIO(bytes(message.data)), formats=("PNG", "JPEG")) as image:
                _check_size(*image.size)
                if image.mode != "RGB":
                    raise UserError(f"its images have the mode {image.mode}, and no red, green and blue")
                return np.array(image)
    except (UserError, MemoryError):
        raise
    except Exception as error:  # a malformed image makes Pillow raise errors of many types
        raise UserError("one of its images cannot be decoded: it is damaged, or no PNG or JPEG") from error


def _check_size(columns: int, rows: int) -> None:
    if not 0 < rows * columns <= MOST_PIXELS:
        raise UserError(f"its image has {columns} x {rows} pixels, and 1 to {MOST_PIXELS} are supported")
