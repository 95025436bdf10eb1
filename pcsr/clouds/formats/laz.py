"""Check of a LAZ file's chunk table before lazrs reads it, which would allocate whatever the table claims, or panic."""

import importlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from mmap import mmap

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import UNCHECKED_SIZE

RECORD = 54
"""Size in bytes of the header of a variable-length record."""
KEY = (b"laszip encoded", 22204)
"""User id and record id of the record that describes the compression."""
LAYERED = 3
"""Number of the compressor that stores points in layers."""
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Number of layers of each type of item: points, colours, colours with infrared, waveforms. An item of another type has
a layer for each byte."""
DAMAGED = "its compressed points are damaged: get the file again"


def check_chunks(data: bytes | mmap, at: int, size: int, count: int) -> None:
    """Check that the chunk table is consistent with the file.

    Args:
        data: the file, or a memory map of it.
        at: index of the first byte of the points.
        size: size of a point in bytes.
        count: number of points.

    Raises:
        UserError: it is not.
    """
    try:
        lazrs = importlib.import_module("lazrs")
    except ImportError:  # laspy reports this
        return
    try:
        record = _record(data)
        packing = lazrs.LazVlr(record)
        start = int.from_bytes(data[at : at + 8], "little", signed=True)
        start = int.from_bytes(data[-8:], "little", signed=True) if start == -1 else start
        room = start - at - 8
        chunks = int.from_bytes(data[start + 4 : start + 8], "little")
        # A chunk begins with one uncompressed point.
        if room < 0 or start + 8 > len(data) or packing.item_size() != size or chunks * size > room:
            raise UserError(DAMAGED)
        file = BytesIO(data) if isinstance(data, bytes) else data
        file.seek(at)
        table = lazrs.read_chunk_table(file, packing)
    except (lazrs.LazrsError, ValueError, OverflowError, TypeError) as error:
        raise UserError(DAMAGED) from error
    held = [points for points, _ in table] if packing.uses_variable_size_chunks() else [packing.chunk_size()] * chunks
    if sum(packed for _, packed in table) > room or sum(held) < count:
        raise UserError(DAMAGED)
    if max(held, default=0) * size > UNCHECKED_SIZE + count * size:
        raise UserError(f"it claims chunks of {max(held)} points and has {count} points: it is damaged")
    layers, at = _layers(record), at + 8
    for _, packed in table if layers else []:
        sizes = np.frombuffer(data[at + size + 4 : at + size + 4 + 4 * layers], "<u4")
        if len(sizes) < layers or int(sizes.sum(dtype=np.int64)) > packed:
            raise UserError(DAMAGED)
        at += packed


def _layers(record: bytes) -> int:
    """Return the number of layers of a chunk, each of which has its size stored; 0 without layers."""
    if int.from_bytes(record[:2], "little") != LAYERED:
        return 0
    layers = 0
    for number in range(int.from_bytes(record[32:34], "little")):
        kind, size = (int.from_bytes(record[34 + 6 * number + at :][:2], "little") for at in (0, 2))
        layers += LAYERS.get(kind, size)
    return layers


def _record(data: bytes | mmap) -> bytes:
    """Return the content of the record that describes the compression."""
    at = int.from_bytes(data[94:96], "little")
    for _ in range(int.from_bytes(data[100:104], "little")):
        size = int.from_bytes(data[at + 20 : at + 22], "little")
        user, number = data[at + 2 : at + 18].rstrip(b"\0"), int.from_bytes(data[at + 18 : at + 20], "little")
        if (user, number) == KEY:
            return data[at + RECORD : at + RECORD + size]
        at += RECORD + size
    raise UserError("it claims to be compressed, but has no record on the compression: get the file again")


@contextmanager
def panics_as_errors() -> Iterator[None]:
    """Raise a panic of lazrs as a `UserError`, without the report that Rust writes to standard error.

    Other output to standard error is delayed to the end of the block, and lost after a panic.

    Raises:
        UserError: lazrs panicked.
    """
    with tempfile.TemporaryFile() as held:
        # Programs without a console have no standard error.
        stderr = os.dup(2) if sys.stderr is not None else os.open(os.devnull, os.O_WRONLY)
        os.dup2(held.fileno(), 2)
        try:
            yield
        except BaseException as error:  # a panic is not derived from `Exception`
            if type(error).__name__ != "PanicException":
                raise
            held.truncate(0)
            raise UserError(DAMAGED) from error
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            held.seek(0)
            while some := held.read(1 << 16):
                os.write(2, some)
