"""Safe reading of NumPy's .npy format: no pickles, and no more memory than the file has bytes."""

import math
import warnings
from io import BufferedIOBase, BytesIO
from typing import Any

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import check_memory, gigabytes

CHUNK = 1 << 20
"""Bytes that are read at once."""

Header = tuple[tuple[int, ...], bool, np.dtype[Any]]
"""Shape, whether the array is in Fortran order, and type."""


def read_header(file: BufferedIOBase) -> Header:
    """Read the header of an .npy file.

    Returns:
        Shape, whether the array is in Fortran order, and its type.

    Raises:
        UserError: there is no valid header.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of headers written by Python 2
        try:
            version = np.lib.format.read_magic(file)
            readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            if version not in readers:
                raise UserError(f"its version {version} is not known: save it by numpy.save")
            shape, fortran, dtype = readers[version](file)
        except UserError:
            raise
        except Exception as error:  # the header is a Python literal, and a malformed one may raise anything
            raise UserError("its beginning is not that of an .npy file of numbers: get the file again") from error
    if not all(isinstance(n, int) and 0 <= n < 2**60 for n in shape):
        raise UserError(f"its header claims an array of shape {_short(shape)}: get the file again")
    return shape, fortran, dtype


def read_array(file: BufferedIOBase, room: int) -> np.ndarray:
    """Read an array of numbers or text from an .npy file.

    Args:
        file: file at its beginning.
        room: size of the file in bytes. It bounds what is read and allocated.

    Raises:
        UserError: the array holds objects, or the file is shorter than its header claims.
    """
    shape, fortran, dtype = read_header(file)
    if dtype.hasobject or dtype.kind not in "biufcSUV" or dtype.itemsize == 0:
        raise UserError(f"it holds items of dtype {_short(dtype)}: points are real numbers")
    size = math.prod(shape) * dtype.itemsize
    room = max(0, room - file.tell())
    if size > room:
        raise UserError(
            f"it is cut off or damaged: its header claims {dtype} of shape {_short(shape)}, "
            f"which take {gigabytes(size)}, and {gigabytes(room)} are there"
        )
    check_memory(size, f"its array ({gigabytes(size)})")
    if size == 0:
        return np.zeros(shape, dtype)
    flat: np.ndarray
    if isinstance(file, BytesIO):
        flat = np.frombuffer(file.getbuffer()[file.tell() : file.tell() + size], dtype)
    else:
        raw = np.zeros(size, np.uint8)  # the system allocates the memory only as it is filled
        at = 0
        while at < size and (part := file.read(min(CHUNK, size - at))):
            raw[at : at + len(part)] = np.frombuffer(part, np.uint8)
            at += len(part)
        if at < size:
            raise UserError(f"it is cut off: {at} bytes of an array of {size} are there: get the file again")
        flat = raw.view(dtype)
    if dtype.kind == "b":
        flat = flat.view(np.uint8) != 0
    return flat.reshape(shape, order="F" if fortran else "C")


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:80]}…"
