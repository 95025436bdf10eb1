"""Reading PLY: every property of the vertices, in text and in both binary orders; other elements are passed over."""

import re
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native
from pcsr.clouds.formats.digits import check_lines, fitting, load_rows
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
ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
DIGITS = 20
"""No file has a count of so many."""
HEADER = 1 << 20
"""A header ends within so many bytes."""
UNEVEN = 10**6
"""Rows with lists of different lengths that are passed over before the vertices: each costs some microseconds."""


@dataclass(frozen=True)
class Property:
    """One property of an element; `length` is the type of a list's length, or empty."""

    name: str
    type: str
    length: str = ""


@dataclass(frozen=True)
class Element:
    """One element of the header."""

    name: str
    count: int
    properties: list[Property]


def read(data: bytes) -> Cloud:
    """The vertices. Coordinates in text are read as doubles, whatever their type says.

    Raises:
        UserError: it is no PLY file, is cut off, lacks a coordinate, or a vertex has lists of different lengths.
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
            raise UserError(f"it cannot be read as a .ply file: '{axis}' is no property of its vertices: {known}")
    if len(set(names)) < len(names):
        raise UserError(f"two properties of its vertices have one name: {', '.join(names)}")
    table = _text(data[at:], element) if encoding == "ascii" else _binary(data, at, element, ORDERS[encoding])
    kind = {each.name: each.type for each in element.properties}
    columns = {}
    for name in names:
        if name not in ("x", "y", "z"):
            columns[name] = native(fitting(table[name], np.dtype(TYPES[kind[name]]), name))
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
    # Comments may be in any encoding: what is not UTF-8 is carried through as it is.
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
        raise UserError(f"an element of its header has more than {MOST_COLUMNS} properties, the most that are read")
    return encoding, comments, elements, found.end()


def _readable(name: str) -> str:
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _type(word: str) -> str:
    name = ALIASES.get(word, word)
    if name not in TYPES:
        raise UserError(f"its header names the type '{word[:80]}': {', '.join(TYPES)} are known")
    return name


def _after(data: bytes, at: int, element: Element, encoding: str) -> int:
    """Where the element that begins at `at` ends."""
    if encoding == "ascii":
        file = BytesIO(data)
        file.seek(at)
        for _ in range(element.count):
            line = file.readline()
            while line and element.properties and not line.strip():  # without properties its rows are empty lines
                line = file.readline()
            if not line:
                raise UserError(f"it is cut off among its {element.count} of '{element.name}'")
        return file.tell()
    order = ORDERS[encoding]
    row, even = _row(data, at, element, order), True
    if row.itemsize and any(each.length for each in element.properties):
        even = _even(_rows(data, at, element, row), element)
    if even:
        return at + element.count * row.itemsize
    if element.count > UNEVEN:
        raise UserError(
            f"its {element.count} of '{element.name}' have lists of different lengths and are before its vertices, and "
            f"{UNEVEN} of such are the most: write the vertices first"
        )
    for _ in range(element.count):  # such as faces of three and of four corners ahead of the vertices
        at += _row(data, at, element, order).itemsize
    return at


def _row(data: bytes, at: int, element: Element, order: str) -> np.dtype[np.void]:
    """The layout of the row that begins at `at`: lists are of the length that they have there."""
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
    """As many rows of one layout as there are, at most those of the element."""
    return np.frombuffer(data, row, min(element.count, max(0, len(data) - at) // row.itemsize), at)


def _even(rows: np.ndarray, element: Element) -> bool:
    """Whether the lists of all rows are as long as those of the first."""
    lengths = [f"length {number}" for number, each in enumerate(element.properties) if each.length]
    return len(rows) == element.count and all(bool((rows[name] == rows[name][0]).all()) for name in lengths)


def _binary(data: bytes, at: int, element: Element, order: str) -> dict[str, np.ndarray]:
    rows = _rows(data, at, element, _row(data, at, element, order))
    for number, each in enumerate(element.properties):
        if each.length and len(rows) and (rows[f"length {number}"] != rows[f"length {number}"][0]).any():
            raise UserError(f"its vertices have lists '{each.name}' of different lengths: they make no column")
    _all_there(len(rows), element)
    return {each.name: rows[f"{number}"] for number, each in enumerate(element.properties)}


def _text(data: bytes, element: Element) -> dict[str, np.ndarray]:
    check_lines(data)
    # Doubles hold every number of every type that PLY has.
    most = len(data) // 2 + 1  # whatever the header claims, so that nobody's claim takes the memory
    rows = load_rows(data.decode("latin-1"), min(element.count, most))
    _all_there(len(rows), element)
    table, at, width = dict[str, np.ndarray](), 0, rows.shape[1]
    for each in element.properties:
        taken: int | slice = at
        if each.length:
            lengths = rows[:, at : at + 1]
            if (lengths != lengths[:1]).any():
                raise UserError(f"its vertices have lists '{each.name}' of different lengths: they make no column")
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
        raise UserError(f"it is cut off: {rows} of its {element.count} points are there")
