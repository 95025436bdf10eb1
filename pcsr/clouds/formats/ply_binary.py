"""Elements of binary PLY files, of which lists may differ in length."""

from array import array
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pcsr.clouds.formats.ply_header import ORDERS, TYPES, Element, Header
from pcsr.errors import UserError

MOST_RAGGED_ROWS = 10**7
"""Most rows of an element with lists of different lengths. Each takes a microsecond."""


@dataclass(frozen=True)
class Rows:
    """Rows of an element."""

    table: dict[str, np.ndarray]
    """Properties by name, (n,) or (n, k). Lists of different lengths are left out."""
    size: int
    """Size of the rows in bytes."""
    end: int
    """Index of the first byte after the rows."""


def read_binary(data: bytes, header: Header, wanted: int) -> Rows:
    """Read an element of a binary file.

    Args:
        data: the file.
        header: its header.
        wanted: index of the element.

    Raises:
        UserError: the file is cut off.
    """
    order, at = ORDERS[header.encoding], header.end
    for element in header.elements[:wanted]:
        at = _end(data, at, element, order)
    element = header.elements[wanted]
    row = _row(data, at, element, order)
    rows = _rows(data, at, element, row)
    lists = any(each.length for each in element.properties)
    if lists and (len(rows) != element.count or not _is_uniform(rows, element)):
        table, end = _ragged(data, at, element, order)
        return Rows(table, end - at, end)
    if len(rows) != element.count:
        raise UserError(f"it is cut off: {len(rows)} of its {element.count} points are there: get the file again")
    table = {each.name: rows[f"{number}"] for number, each in enumerate(element.properties)}
    return Rows(table, rows.nbytes, at + rows.nbytes)


def _end(data: bytes, at: int, element: Element, order: str) -> int:
    """Return the end of the element that begins at `at`."""
    row = _row(data, at, element, order)
    if row.itemsize and any(each.length for each in element.properties):
        rows = _rows(data, at, element, row)
        if len(rows) != element.count or not _is_uniform(rows, element):
            return _ragged(data, at, element, order)[1]
    return at + element.count * row.itemsize


def _row(data: bytes, at: int, element: Element, order: str) -> np.dtype[np.void]:
    """Return the layout of the row that begins at `at`, with the lengths of its lists."""
    parts: list[tuple[str, str, tuple[int, ...]]] = []
    size = 0
    for number, each in enumerate(element.properties):
        shape: tuple[int, ...] = ()
        if each.length and element.count:
            length = np.dtype(order + TYPES[each.length])
            if at + size + length.itemsize > len(data):
                raise UserError("it is cut off in the middle of a list")
            shape = (int(np.frombuffer(data, length, 1, at + size)[0]),)
            if not 0 <= shape[0] <= (len(data) - at - size) // np.dtype(TYPES[each.type]).itemsize:
                raise UserError(f"it has a list of {shape[0]} numbers, more than the file has room for")
            parts.append((f"length {number}", length.str, ()))
            size += length.itemsize
        parts.append((f"{number}", order + TYPES[each.type], shape))
        size += np.dtype(TYPES[each.type]).itemsize * (shape[0] if shape else 1)
    return np.dtype(parts)


def _rows(data: bytes, at: int, element: Element, row: np.dtype[np.void]) -> np.ndarray:
    """Return the rows of one layout from `at` on, as many as the element has or the data contain."""
    return np.frombuffer(data, row, min(element.count, max(0, len(data) - at) // row.itemsize), at)


def _is_uniform(rows: np.ndarray, element: Element) -> bool:
    """Return whether the lists of all rows are as long as those of the first."""
    lengths = [f"length {number}" for number, each in enumerate(element.properties) if each.length]
    return all(bool((rows[name] == rows[name][:1]).all()) for name in lengths)


def _ragged(data: bytes, at: int, element: Element, order: str) -> tuple[dict[str, np.ndarray], int]:
    """Return the properties of an element that are no lists, and its end.

    Raises:
        UserError: there are too many rows, or the file is cut off.
    """
    what = "points" if element.name.lower() == "vertex" else f"of '{element.name}'"
    least = sum(np.dtype(TYPES[each.length or each.type]).itemsize for each in element.properties)
    if element.count * least > len(data) - at:
        raise UserError(
            f"it is cut off: at most {max(0, len(data) - at) // least} of its {element.count} {what} are there: "
            f"get the file again"
        )
    if element.count > MOST_RAGGED_ROWS:
        raise UserError(
            f"its {element.count} of '{element.name}' have lists of different lengths, and {MOST_RAGGED_ROWS} of such "
            f"are the most: save it without the lists"
        )
    runs: list[list[tuple[str, str]]] = [[]]  # numbers between the lists
    lists: list[tuple[int, int, bool]] = []  # size of the length, size of an item, whether the length has a sign
    for number, each in enumerate(element.properties):
        if each.length:
            kind = np.dtype(TYPES[each.length])
            lists.append((kind.itemsize, np.dtype(TYPES[each.type]).itemsize, kind.kind == "i"))
            runs.append([])
        else:
            runs[-1].append((f"{number}", order + TYPES[each.type]))
    sizes = [np.dtype(run).itemsize for run in runs]
    steps = list(zip(sizes, [*lists, (0, 0, False)], strict=True))
    byte_order: Literal["big", "little"] = "big" if order == ">" else "little"
    starts = array("q")
    for number in range(element.count):
        for size, (width, item, signed) in steps:
            starts.append(at)
            at += size
            length = int.from_bytes(data[at : at + width], byte_order, signed=signed)
            if length < 0:
                raise UserError(f"row {number} of its '{element.name}' has a list of {length} numbers: it is damaged")
            at += width + item * length
        if at > len(data):
            raise UserError(f"it is cut off: {number} of its {element.count} {what} are there: get the file again")
    table: dict[str, np.ndarray] = {}
    raw = np.frombuffer(data, np.uint8)
    begins = np.frombuffer(starts, np.int64).reshape(element.count, len(runs))
    for number, (run, size) in enumerate(zip(runs, sizes, strict=True)):
        if run:
            block = raw[begins[:, number, None] + np.arange(size)].view(np.dtype(run))[:, 0]
            table |= {element.properties[int(name)].name: block[name] for name, _ in run}
    return table, at
