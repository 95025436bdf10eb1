"""Reader of the vertices of PLY files, in text and both binary byte orders; other elements are skipped."""

import re
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native
from pcsr.clouds.formats.digits import cast_column, check_lines, load_rows
from pcsr.errors import UserError
from pcsr.limits import MOST_COLUMNS

TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
}
"""NumPy's type of each PLY type."""
ALIASES = {
    "int8": "char",
    "uint8": "uchar",
    "int16": "short",
    "uint16": "ushort",
    "int32": "int",
    "uint32": "uint",
    "float32": "float",
    "float64": "double",
}
"""PLY types with other names."""
ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
"""NumPy's byte order of each encoding."""
DIGITS = 20
"""Counts in a header must have fewer digits than this."""
HEADER = 1 << 20
"""Largest size of a header in bytes."""
MOST_RAGGED_ROWS = 10**6
"""Most rows with lists of different lengths that are skipped before the vertices. Each takes some microseconds."""


@dataclass(frozen=True)
class Property:
    """Property of an element in the header."""

    name: str
    type: str
    length: str = ""
    """Type of the length of a list; empty for a single number."""


@dataclass(frozen=True)
class Element:
    """Element in the header."""

    name: str
    count: int
    properties: list[Property]


def read(data: bytes) -> Cloud:
    """Read the vertices. Coordinates in text are read in double precision, whatever their declared type.

    Raises:
        UserError: it is no PLY file, is cut off, lacks a coordinate, or the lists of its vertices differ in length.
    """
    encoding, comments, elements, at = _header(data)
    for element in elements:
        if element.name == "vertex":
            break
        at = _after(data, at, element, encoding)
    else:
        raise UserError(f"it has no vertices, only {', '.join(e.name for e in elements) or 'an empty header'}")
    if element.count == 0:
        raise UserError("it holds no points")
    names = [each.name for each in element.properties]
    for axis in "xyz":
        if axis not in names:
            known = ", ".join(names)
            raise UserError(f"it cannot be read as a .ply file: '{axis}' is none of its vertices' properties: {known}")
    if len(set(names)) < len(names):
        raise UserError(f"two properties of its vertices have the same name: {', '.join(names)}: rename one of them")
    table = _text(data[at:], element) if encoding == "ascii" else _binary(data, at, element, ORDERS[encoding])
    kind = {each.name: each.type for each in element.properties}
    columns = {}
    for name in names:
        if name not in ("x", "y", "z"):
            columns[name] = native(cast_column(table[name], np.dtype(TYPES[kind[name]]), name))
    points = np.stack([np.asarray(table[axis], np.float64) for axis in "xyz"], axis=-1)
    about = {"encoding": encoding, "comments": comments, "coordinates": kind["x"]}
    return Cloud(points, columns, {"ply": about})


def _header(data: bytes) -> tuple[str, list[str], list[Element], int]:
    found = re.match(rb"(ply[ \t]*\r?\n.*?\n)end_header[ \t]*\r?\n", data[:HEADER], re.DOTALL)
    if not found:
        what = (
            f"its header has no end within {HEADER} bytes"
            if re.match(rb"ply\s", data)
            else "it does not begin with the line 'ply'"
        )
        raise UserError(f"it cannot be read as a .ply file: {what}")
    encoding, comments, elements = "", [], list[Element]()
    # Comments may have any encoding: bytes that are not UTF-8 are kept unchanged.
    for line in found[1].decode("utf-8", "surrogateescape").replace("\r", "").split("\n")[1:]:
        match line.split():
            case ["format", name, *_]:
                encoding = name
            case ["comment" | "obj_info", *_]:
                comments.append(line)
            case ["element", name, count] if count.isdecimal() and len(count) < DIGITS:
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, kind, name] if elements:
                elements[-1].properties.append(Property(_readable(name), _type(kind), _type(length)))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(Property(_readable(name), _type(kind)))
            case []:
                pass
            case _:
                raise UserError(f"it cannot be read as a .ply file: its header has the line '{line.strip()[:80]}'")
    if encoding not in ORDERS:
        raise UserError(f"its format is '{encoding[:80]}': {', '.join(ORDERS)} are known")
    if any(len(element.properties) > MOST_COLUMNS for element in elements):
        raise UserError(f"an element of its header has more than {MOST_COLUMNS} properties, the most that is allowed")
    return encoding, comments, elements, found.end()


def _readable(name: str) -> str:
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _type(word: str) -> str:
    name = ALIASES.get(word, word)
    if name not in TYPES:
        raise UserError(f"its header names the type '{word[:80]}': {', '.join(TYPES)} are known")
    return name


def _after(data: bytes, at: int, element: Element, encoding: str) -> int:
    """Return the end of the element that begins at `at`."""
    if encoding == "ascii":
        file = BytesIO(data)
        file.seek(at)
        for _ in range(element.count):
            line = file.readline()
            while line and element.properties and not line.strip():  # rows without properties are empty lines
                line = file.readline()
            if not line:
                raise UserError(f"it is cut off among its {element.count} of '{element.name}': get the file again")
        return file.tell()
    order = ORDERS[encoding]
    row, uniform = _row(data, at, element, order), True
    if row.itemsize and any(each.length for each in element.properties):
        uniform = _is_uniform(_rows(data, at, element, row), element)
    if uniform:
        return at + element.count * row.itemsize
    if element.count > MOST_RAGGED_ROWS:
        raise UserError(
            f"its {element.count} of '{element.name}' before the vertices have lists of different lengths, and "
            f"{MOST_RAGGED_ROWS} of such are the most: write the vertices first"
        )
    for _ in range(element.count):  # such as triangles and quadrilaterals before the vertices
        at += _row(data, at, element, order).itemsize
    return at


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
    """Return whether all rows are there and their lists are as long as those of the first."""
    lengths = [f"length {number}" for number, each in enumerate(element.properties) if each.length]
    return len(rows) == element.count and all(bool((rows[name] == rows[name][0]).all()) for name in lengths)


def _binary(data: bytes, at: int, element: Element, order: str) -> dict[str, np.ndarray]:
    rows = _rows(data, at, element, _row(data, at, element, order))
    for number, each in enumerate(element.properties):
        if each.length and len(rows) and (rows[f"length {number}"] != rows[f"length {number}"][0]).any():
            raise UserError(f"its vertices have lists '{each.name}' of different lengths: a column needs equal ones")
    _all_there(len(rows), element)
    return {each.name: rows[f"{number}"] for number, each in enumerate(element.properties)}


def _text(data: bytes, element: Element) -> dict[str, np.ndarray]:
    check_lines(data)
    # Double precision represents every number of every PLY type.
    most = len(data) // 2 + 1  # bounds the memory, whatever the header claims
    rows = load_rows(data.decode("latin-1"), min(element.count, most))
    _all_there(len(rows), element)
    table, at, width = dict[str, np.ndarray](), 0, rows.shape[1]
    for each in element.properties:
        taken: int | slice = at
        if each.length:
            lengths = rows[:, at : at + 1]
            if (lengths != lengths[:1]).any():
                raise UserError(
                    f"its vertices have lists '{each.name}' of different lengths: a column needs equal ones"
                )
            length = float(lengths[0, 0]) if at < width else 0.0
            if not (length >= 0 and length.is_integer()):
                raise UserError(f"its vertices have lists '{each.name}' of {length:g} numbers, which is no length")
            taken = slice(at + 1, at + 1 + int(length) if at < width else width + 1)
        at = taken.stop if isinstance(taken, slice) else at + 1
        if at > width:
            raise UserError(f"its vertices have {width} numbers each, at least {at} are needed")
        table[each.name] = rows[:, taken]
    if at != width:
        raise UserError(f"its vertices have {width} numbers each, {at} are needed")
    return table


def _all_there(rows: int, element: Element) -> None:
    if rows != element.count:
        raise UserError(f"it is cut off: {rows} of its {element.count} points are there: get the file again")
