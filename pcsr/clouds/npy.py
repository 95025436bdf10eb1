"""Arrays of NumPy's own format, from a file or a part of an archive: as large as there are bytes for, and no larger."""

import math
import warnings
from io import BufferedIOBase, BytesIO
from typing import Any

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import check_memory, gigabytes

CHUNK = 1 << 20

Header = tuple[tuple[int, ...], bool, np.dtype[Any]]


def read_header(file: BufferedIOBase) -> Header:
    """Shape, whether it is in Fortran's order, and type of the array whose bytes follow.

    Raises:
        UserError: it is no header of an .npy file.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that Python 2 wrote it
        try:
            version = np.lib.format.read_magic(file)
            readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            if version not in readers:
                raise UserError(f"its version {version} is not known, save it by numpy.save")
            shape, fortran, dtype = readers[version](file)
        except UserError:
            raise
        except Exception as error:  # the header is a Python literal: a malformed one trips over anything
            raise UserError("its beginning is not that of an .npy file of numbers: get the file again") from error
    if not all(isinstance(n, int) and 0 <= n < 2**60 for n in shape):
        raise UserError(f"it says that it holds an array of shape {_short(shape)}: get the file again")
    return shape, fortran, dtype


def read_array(file: BufferedIOBase, room: int) -> np.ndarray:
    """The array of numbers or text that a file holds.

    Args:
        file: at its beginning.
        room: bytes that it has, or claims to have; no more are read, and no more memory is taken.

    Raises:
        UserError: it holds objects, or fewer bytes than its header says.
    """
    shape, fortran, dtype = read_header(file)
    if dtype.hasobject or dtype.kind not in "biufcSUV" or dtype.itemsize == 0:
        raise UserError(f"it holds items of dtype {_short(dtype)}: points are real numbers")
    size = math.prod(shape) * dtype.itemsize
    room = max(0, room - file.tell())
    if size > room:
        raise UserError(
            f"it is cut off or damaged: it says that it holds {dtype} of shape {_short(shape)}, "
            f"which are {gigabytes(size)}, and {gigabytes(room)} are there"
        )
    check_memory(size, f"its array ({gigabytes(size)})")
    if size == 0:
        return np.zeros(shape, dtype)
    flat: np.ndarray
    if isinstance(file, BytesIO):
        flat = np.frombuffer(file.getbuffer()[file.tell() : file.tell() + size], dtype)
    else:
        raw = np.zeros(size, np.uint8)  # the system gives memory for it as it is filled
        at = 0
        while at < size and (part := file.read(min(CHUNK, size - at))):
            raw[at : at + len(part)] = np.frombuffer(part, np.uint8)
            at += len(part)
        if at < size:
            raise UserError(f"it is cut off: {at} bytes of an array of {size} are there")
        flat = raw.view(dtype)
    if dtype.kind == "b":
        flat = flat.view(np.uint8) != 0
    return flat.reshape(shape, order="F" if fortran else "C")


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:80]}…"
