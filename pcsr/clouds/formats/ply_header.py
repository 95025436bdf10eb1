"""Header of PLY files: encoding, comments, and the elements with their properties."""

import re
from dataclasses import dataclass, replace

from pcsr.clouds.columns import unused
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


@dataclass(frozen=True)
class Header:
    """Header of a PLY file."""

    encoding: str
    """A key of `ORDERS`."""
    comments: list[str]
    elements: list[Element]
    end: int
    """Size in bytes."""


def parse(data: bytes) -> Header:
    """Read the header of a PLY file.

    Raises:
        UserError: there is no header, or a line of it is not understood.
    """
    begins = re.match(rb"ply[ \t]*(\r\n|\r|\n)", data)
    line_end = rb"\r" if begins and begins[1] == b"\r" else rb"\r?\n"
    found = re.match(
        rb"(ply[ \t]*(?:%b).*?(?:%b))[ \t]*end_header[ \t]*(?:%b)" % ((line_end,) * 3), data[:HEADER], re.S
    )
    if not found:
        what = f"its header has no end within {HEADER} bytes" if begins else "it does not begin with the line 'ply'"
        raise UserError(f"it cannot be read as a .ply file: {what}")
    encoding, comments, elements = "", [], list[Element]()
    # Comments may have any encoding: bytes that are not UTF-8 are kept unchanged.
    for line in found[1].decode("utf-8", "surrogateescape").replace("\r", "\n").split("\n")[1:]:
        match line.split():
            case ["format", name, *_]:
                encoding = name
            case ["comment" | "obj_info", *_]:
                comments.append(line)
            case ["element", name, count] if count.isdecimal() and len(count) < DIGITS:
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, kind, name, *more] if elements:
                elements[-1].properties.append(Property(_readable(name, *more), _type(kind), _length(length)))
            case ["property", kind, name, *more] if elements:
                elements[-1].properties.append(Property(_readable(name, *more), _type(kind)))
            case []:
                pass
            case _:
                raise UserError(f"it cannot be read as a .ply file: its header has the line '{line.strip()[:80]}'")
    if encoding not in ORDERS:
        raise UserError(f"its format is '{encoding[:80]}': {', '.join(ORDERS)} are known")
    if any(len(element.properties) > MOST_COLUMNS for element in elements):
        raise UserError(f"an element of its header has more than {MOST_COLUMNS} properties, the most that is allowed")
    return Header(encoding, comments, elements, found.end())


def vertices(header: Header) -> tuple[int, list[str]]:
    """Return the index of the element with the vertices, and notes on properties that were renamed.

    The element in `header` is replaced: coordinates get small letters, and a second property of a name another name.

    Raises:
        UserError: there are no vertices, or a coordinate is missing, a list, or there twice.
    """
    names = [element.name.lower() for element in header.elements]
    if "vertex" not in names:
        raise UserError(f"it has no vertices, only {', '.join(names) or 'an empty header'}")
    at = names.index("vertex")
    element = header.elements[at]
    properties, notes = list[Property](), list[str]()
    exact = {each.name for each in element.properties}
    for each in element.properties:
        lower = each.name.lower()
        name = lower if lower in ("x", "y", "z") and lower not in exact else each.name
        free = unused(name, [one.name for one in properties])
        if free != name and name in ("x", "y", "z"):
            known = ", ".join(one.name for one in element.properties)
            raise UserError(f"two properties of its vertices are the coordinate {name}: {known}: rename one of them")
        if free != name:
            notes.append(f"two properties of its vertices are called '{name}': the second is read as '{free}'")
        properties.append(replace(each, name=free))
    single = {each.name for each in properties if not each.length}
    for axis in "xyz":
        if axis not in single:
            known = ", ".join(each.name for each in properties)
            hint = ": these are compressed splats, convert them to plain ones" if "packed_position" in single else ""
            raise UserError(
                f"it cannot be read as a .ply file: '{axis}' is none of its vertices' properties: {known}{hint}"
            )
    header.elements[at] = replace(element, properties=properties)
    return at, notes


def _readable(*words: str) -> str:
    return "_".join(words).encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _type(word: str) -> str:
    name = ALIASES.get(word.lower(), word.lower())
    if name not in TYPES:
        raise UserError(f"its header names the type '{word[:80]}': {', '.join(TYPES)} are known")
    return name


def _length(word: str) -> str:
    name = _type(word)
    if name in ("float", "double"):
        raise UserError(f"its header has lists whose length is a '{word}': lengths are integers")
    return name
