"""Names of the columns of text files: finding the coordinates, colours and normals by the names that people use."""

import csv
import re
from collections.abc import Sequence

from pcsr.clouds.columns import COLOURS, NORMALS
from pcsr.errors import UserError

AXES = {
    "x": ("easting", "east", "rechtswert", "ostwert", "e"),
    "y": ("northing", "north", "hochwert", "nordwert", "n"),
    "z": ("height", "elevation", "elev", "altitude", "alt", "up", "hoehe", "höhe", "hohe", "h", "u"),
}
"""Names of coordinates that do not contain x, y or z."""
DEGREES = {"lat", "latitude", "lon", "long", "lng", "longitude"}
"""Names of coordinates in degrees."""
UNITS = {"m", "mm", "cm", "km", "ft", "feet", "in", "inch", "inches", "usft", "meter", "meters", "metre", "metres"}
"""Units in the names of columns: x_mm."""
POSITION = re.compile(
    r"(?:coordinates?|coords?|koordinaten?|points?|position|pos|cartesian|local|global|world|utm|pt|p)*([xyz])"
    r"(?:coordinates?|coords?|koordinaten?|pos|local|global|world|utm)*"
)
"""Name of a coordinate without separators and units, such as "coordx" or "posx"."""
COLOUR = re.compile(r"(?:colou?rs?|diffuse|rgba?|vertex)*(red|green|blue|alpha)(?:f|8bit|u?char)?")
"""Name of a channel of the colours without separators, such as "diffusered"."""
LETTER_OF_COLOUR = re.compile(r"(?:colou?rs?|diffuse|rgba?|vertex)*([rgba])(?:f|8bit|u?char)?")
"""Name of a channel of the colours that ends in its letter, such as "colorr" or "rf"."""
NORMAL = re.compile(r"(?:normals?|nrm|norm|n)([xyz])")
"""Name of a component of the normals without separators, such as "normalx"."""
BRACKETS = re.compile(r"(?<!\s)\s*+(?:\([^()]*\)|\[[^\[\]]+\])")
"""Unit or remark in brackets; empty brackets mark a list."""
LIST = re.compile(r"(?<!\s)\s++as\s*+\([^()]*\)\s*$")
"""Explanation of a list of varying length at the end of COLMAP's line of names."""
WORD_OF_AXIS = re.compile(r"\b(?:coord(?:inate)?s?|pos(?:ition)?|point)\.?[ \t]+(?=[xyz]\b)", re.IGNORECASE)
"""Word before the letter of an axis, such as "Coord." in "Coord. X"."""
PARAVIEW = {"points": "xyz", "normals": "xyz", "colors": "rgb", "rgb": "rgb"}
"""Names of ParaView's arrays, whose columns are called Points:0 and so on, and the letters of these columns."""
SKIPPED = ("-", "_", "")
"""Names by which a list of columns skips one."""


def split_names(line: str) -> list[str]:
    """Split a line of column names, commented or not, at its semicolons, tabs, bars, commas or white space."""
    line = LIST.sub("", line.strip(" \r\n").lstrip("#/%! "))
    for separator in (";", "\t", "|", ","):
        if separator in BRACKETS.sub("", line):
            return [name.strip() for name in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    return [name.strip("\"'") for name in WORD_OF_AXIS.sub("", BRACKETS.sub("", line)).split()]


def find_axes(names: Sequence[str]) -> list[int]:
    """Return the indices of the columns x, y and z; nothing if one of them has no name.

    Plain names, x, y and z, come before others, such as "X [m]", "Coord. X" or "Easting".

    Raises:
        UserError: two columns may be the same coordinate.
    """
    plain = [name.strip().lower() for name in names]
    if {"x", "y", "z"} <= set(plain):
        return [plain.index(axis) for axis in "xyz"]
    for meaning in (_by_letter, _by_word):
        meant = [meaning(name) for name in names]
        if {"x", "y", "z"} <= set(meant):
            for axis in "xyz":
                if meant.count(axis) > 1:
                    both = " and ".join(f"'{name}'" for name, each in zip(names, meant, strict=True) if each == axis)
                    raise UserError(f"its columns {both[:200]} may both be {axis}: say which is, by --columns x,y,z")
            return [meant.index(axis) for axis in "xyz"]
    return []


def has_axis(names: Sequence[str]) -> bool:
    """Return whether a name is that of a coordinate by its letter, x, y or z."""
    return any(map(_by_letter, names))


def in_degrees(names: Sequence[str]) -> bool:
    """Return whether the names are those of geographic coordinates."""
    return len({_bare(name) for name in names} & DEGREES) > 1


def standard_names(names: Sequence[str]) -> dict[int, str]:
    """Return the standard names of complete colours and normals (red, green, blue, nx, ny, nz) by index of column."""
    standard: dict[int, str] = {}
    for pattern, group in ((COLOUR, COLOURS), (LETTER_OF_COLOUR, COLOURS), (NORMAL, NORMALS)):
        if set(standard.values()) & set(group):
            continue
        found: dict[str, int] = {}
        for index, name in enumerate(names):
            if match := pattern.fullmatch(_bare(name)):
                exact = next(each for each in group if match[1] in (each, each[0], each[-1]))
                if exact not in found or name == exact:
                    found[exact] = index
        if found.keys() >= set(group[:3]):
            standard |= {index: name for name, index in found.items()}
    return standard


def given_names(columns: str | Sequence[str]) -> list[str]:
    """Return the names in a list such as "x,y,z,-,red,green,blue"; skipped columns are empty.

    Raises:
        UserError: x, y or z is missing, or a name is there twice.
    """
    words = columns.split("," if "," in columns else None) if isinstance(columns, str) else list(columns)
    names = ["" if word.strip() in SKIPPED else word.strip() for word in words]
    shown = ",".join(map(str, words))[:200]
    found = [name.lower() for name in names if name]
    for name in found:
        if found.count(name) > 1:
            raise UserError(f"--columns {shown} has '{name[:80]}' twice: give each column a name of its own")
    if not find_axes(names):
        raise UserError(f"--columns {shown} must name x, y and z, such as --columns x,y,z,-,red,green,blue")
    return names


def _bare(name: str) -> str:
    """Return a name in lower case without units and separators."""
    words = [word for word in re.split(r"[\W_]+", BRACKETS.sub("", name).lower()) if word]
    if len(words) == 2 and words[1] in ("0", "1", "2") and words[0] in PARAVIEW:
        return words[0] + PARAVIEW[words[0]][int(words[1])]
    return "".join(words[:1] + [word for word in words[1:] if word not in UNITS])


def _by_letter(name: str) -> str:
    match = POSITION.fullmatch(_bare(name))
    return match[1] if match else ""


def _by_word(name: str) -> str:
    bare = _bare(name).removeprefix("utm")
    return next((axis for axis, words in AXES.items() if bare in words), _by_letter(name))
