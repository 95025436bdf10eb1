"""LAZ's table of chunks, looked at before lazrs does: it would take whatever memory the table asks for, or give up."""

import importlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import UNCHECKED_SIZE

RECORD = 54
"""Bytes of the head of a record after the header."""
KEY = (b"laszip encoded", 22204)
"""User and number of the record that says how the points are packed."""
LAYERED = 3
"""The compressor that packs in layers."""
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Of each kind of item: points, colours, colours with infrared, waves. Of others, each byte is one."""
DAMAGED = "its compressed points are damaged: get the file again"


def check_chunks(data: bytes, at: int, size: int, count: int) -> None:
    """Refuse a table of chunks that contradicts the file.

    Args:
        data: the file.
        at: where its points begin.
        size: bytes of a point.
        count: of points.

    Raises:
        UserError: it does.
    """
    try:
        lazrs = importlib.import_module("lazrs")
    except ImportError:  # laspy says so, and what to install
        return
    try:
        record = _record(data)
        packing = lazrs.LazVlr(record)
        start = int.from_bytes(data[at : at + 8], "little", signed=True)
        start = int.from_bytes(data[-8:], "little", signed=True) if start == -1 else start
        room = start - at - 8
        chunks = int.from_bytes(data[start + 4 : start + 8], "little")
        # A chunk begins with one whole point.
        if room < 0 or start + 8 > len(data) or packing.item_size() != size or chunks * size > room:
            raise UserError(DAMAGED)
        file = BytesIO(data)
        file.seek(at)
        table = lazrs.read_chunk_table(file, packing)
    except (lazrs.LazrsError, ValueError, OverflowError, TypeError) as error:
        raise UserError(DAMAGED) from error
    held = [points for points, _ in table] if packing.uses_variable_size_chunks() else [packing.chunk_size()] * chunks
    if sum(packed for _, packed in table) > room or sum(held) < count:
        raise UserError(DAMAGED)
    if max(held, default=0) * size > UNCHECKED_SIZE + count * size:
        raise UserError(f"its points are said to be packed {max(held)} at once, and it has {count}: it is damaged")
    layers, at = _layers(record), at + 8
    for _, packed in table if layers else []:
        sizes = np.frombuffer(data[at + size + 4 : at + size + 4 + 4 * layers], "<u4")
        if len(sizes) < layers or int(sizes.sum(dtype=np.int64)) > packed:
            raise UserError(DAMAGED)
        at += packed


def _layers(record: bytes) -> int:
    """Of how many layers, each with a size before it, a chunk consists; 0 where it is not in layers."""
    if int.from_bytes(record[:2], "little") != LAYERED:
        return 0
    layers = 0
    for number in range(int.from_bytes(record[32:34], "little")):
        kind, size = (int.from_bytes(record[34 + 6 * number + at :][:2], "little") for at in (0, 2))
        layers += LAYERS.get(kind, size)
    return layers


def _record(data: bytes) -> bytes:
    """What the record says that describes the packing."""
    at = int.from_bytes(data[94:96], "little")
    for _ in range(int.from_bytes(data[100:104], "little")):
        size = int.from_bytes(data[at + 20 : at + 22], "little")
        user, number = data[at + 2 : at + 18].rstrip(b"\0"), int.from_bytes(data[at + 18 : at + 20], "little")
        if (user, number) == KEY:
            return data[at + RECORD : at + RECORD + size]
        at += RECORD + size
    raise UserError("it is said to be compressed, and no record says how: get the file again")


@contextmanager
def panics_as_errors() -> Iterator[None]:
    """Turn a panic of lazrs into an error, without the report that Rust writes to standard error.

    What others write there meanwhile is written once the block ends, or lost if it ends in a panic.

    Raises:
        UserError: lazrs panicked.
    """
    with tempfile.TemporaryFile() as held:
        stderr = os.dup(2) if sys.stderr is not None else os.open(os.devnull, os.O_WRONLY)  # of a window it is closed
        os.dup2(held.fileno(), 2)
        try:
            yield
        except BaseException as error:  # a panic is no `Exception`
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
