"""Header of PCD files of all versions, and what it leaves out."""

import re
from dataclasses import dataclass, field

from pcsr.clouds.columns import unused
from pcsr.clouds.formats.digits import check_lines
from pcsr.errors import UserError
from pcsr.limits import check_inflated

HEADER = 1 << 16
"""Largest size of a header in bytes."""
KINDS = {*((kind, size) for kind in "IU" for size in (1, 2, 4, 8)), ("F", 4), ("F", 8)}
"""Types of fields and their sizes in bytes."""
DIGITS = 20
"""Numbers in a header must have fewer digits than this."""
WIDEST = 10_000
"""Most numbers of a point."""
VIEWPOINT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Viewpoint of a file that names none."""
ENCODINGS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True)
class Field:
    """Field of a point."""

    name: str
    """Name, which no other field has; empty for padding."""
    type: str
    """NumPy's type."""
    count: int


@dataclass(frozen=True)
class Header:
    """Header of a PCD file."""

    fields: list[Field]
    points: int
    viewpoint: tuple[float, ...]
    encoding: str
    """One of `ENCODINGS`."""
    end: int
    """Size in bytes."""
    notes: list[str] = field(default_factory=list)


def parse(data: bytes) -> Header:
    """Read the header of a PCD file, and check that the file has room for its points.

    Fields without numbers (COUNT 0) are left out. Keywords that older versions lack get their defaults.

    Raises:
        UserError: the header is incomplete or does not fit the data.
    """
    end = re.search(rb"^[ \t]*DATA[ \t]+(\w+)[ \t]*\r?\n", data[:HEADER], re.MULTILINE | re.IGNORECASE)
    if not end:
        raise UserError(
            f"it cannot be read as a .pcd file: its header has no line DATA within {HEADER} bytes: get the file again"
        )
    lines = data[: end.start()].decode("utf-8", "replace").splitlines()
    header = {words[0].upper(): words[1:] for words in map(str.split, lines) if len(words) > 1}
    encoding = end[1].decode().lower()
    if encoding not in ENCODINGS:
        raise UserError(f"its DATA is '{encoding[:80]}': ascii, binary and binary_compressed are known")
    fields, notes = _fields(header)
    size = sum(int(one.type[1:]) * one.count for one in fields)
    there = _there(data, end.end(), encoding, size)
    points, more = _points(header, there)
    if there < points:
        raise UserError(f"it is cut off: {there} of its {points} points are there: get the file again")
    if there > points and encoding == "binary_compressed":
        raise UserError(
            f"its compressed data claim {there * size} bytes, and its {points} points take {points * size}: it is "
            f"damaged"
        )
    if there > points:
        notes.append(f"its data have {there} points and its header claims {points}: the rest was left out")
    return Header(fields, points, _viewpoint(header), encoding, end.end(), [*notes, *more])


def _fields(header: dict[str, list[str]]) -> tuple[list[Field], list[str]]:
    names = header.get("FIELDS", header.get("COLUMNS", []))
    if not names:
        raise UserError("its header has no line FIELDS")
    sizes = _integers(header, "SIZE", len(names), "4")
    counts = _integers(header, "COUNT", len(names), "1")
    types = [word.upper() for word in header.get("TYPE", ["F"] * len(names))]
    if len(types) != len(names) or not set(zip(types, sizes, strict=True)) <= KINDS:
        raise UserError("its TYPE and SIZE must be I or U with 1, 2, 4 or 8, or F with 4 or 8, for each field")
    if sum(counts) > WIDEST:
        raise UserError(f"its COUNT is {' '.join(header['COUNT'])[:80]}: {WIDEST} numbers for each point are the most")
    fields, notes = list[Field](), list[str]()
    for name, kind, size, count in zip(names, types, sizes, counts, strict=True):
        if count == 0:
            notes.append(f"its field '{name}' has no numbers (COUNT 0) and was left out")
            continue
        if name == "_":  # padding
            fields.append(Field("", f"{kind.lower()}{size}", count))
            continue
        lower = name.lower()
        plain = lower if lower in ("x", "y", "z") and lower not in names else name
        free = unused(plain, [one.name for one in fields])
        if plain in ("x", "y", "z") and (free != plain or count != 1):
            what = "is there twice" if free != plain else f"has {count} numbers for each point"
            raise UserError(f"its field {plain} {what}: its FIELDS are {' '.join(names)[:200]}")
        if free != plain:
            notes.append(f"two of its fields are called '{plain}': the second is read as '{free}'")
        fields.append(Field(free, f"{kind.lower()}{size}", count))
    known = [one.name for one in fields]
    missing = [axis for axis in "xyz" if axis not in known]
    if missing:
        raise UserError(f"it has no field {', '.join(missing)}, only {', '.join(filter(None, known))}")
    return fields, notes


def _there(data: bytes, at: int, encoding: str, size: int) -> int:
    """Return the number of points that the data have.

    Args:
        data: the file.
        at: size of the header in bytes.
        encoding: encoding of the data.
        size: size of a point in bytes.

    Raises:
        UserError: the compressed data are cut off, or too large.
    """
    if encoding == "ascii":
        check_lines(data, at)
        return sum(1 for line in data[at:].splitlines() if line.strip())
    if encoding == "binary":
        return (len(data) - at) // size
    packed, unpacked = (int.from_bytes(data[at + k : at + k + 4], "little") for k in (0, 4))
    if len(data) - at < 8 + packed:
        raise UserError(
            f"it is cut off: {max(0, len(data) - at - 8)} of {packed} compressed bytes are there: get the file again"
        )
    check_inflated(packed, unpacked)
    if unpacked % size:
        raise UserError(
            f"its compressed data claim {unpacked} bytes, which are no multiple of a point's {size}: it is damaged"
        )
    return unpacked // size


def _points(header: dict[str, list[str]], there: int) -> tuple[int, list[str]]:
    """Return the number of points that the header claims, and a note if it claims two.

    Raises:
        UserError: it claims none, or two, and neither fits the data.
    """
    claimed = {key: _integers(header, key, 1, "")[0] for key in ("WIDTH", "HEIGHT", "POINTS") if key in header}
    if not claimed.keys() & {"WIDTH", "POINTS"}:
        raise UserError("its header has neither POINTS nor WIDTH: get the file again")
    points = claimed.get("POINTS")
    area = claimed["WIDTH"] * max(1, claimed.get("HEIGHT", 1)) if "WIDTH" in claimed else None
    if points is None or area is None or points == area:
        return next(number for number in (points, area) if number is not None), []
    if there not in (points, area):
        raise UserError(
            f"its POINTS are {points}, its WIDTH × HEIGHT is {area}, and its data have {there} points: it is damaged"
        )
    return there, [f"its POINTS are {points} and its WIDTH × HEIGHT is {area}: {there} are read, as its data have"]


def _viewpoint(header: dict[str, list[str]]) -> tuple[float, ...]:
    try:
        found = tuple(map(float, header["VIEWPOINT"]))
    except (KeyError, ValueError):
        return VIEWPOINT
    return found if len(found) == len(VIEWPOINT) else VIEWPOINT


def _integers(header: dict[str, list[str]], key: str, count: int, default: str) -> list[int]:
    """Return the integers of a line of the header."""
    words = header.get(key, [default] * count)
    if len(words) < count or not all(word.isdecimal() and len(word) < DIGITS for word in words[:count]):
        needed = "an integer is" if count == 1 else f"{count} integers are"
        raise UserError(f"its {key} is '{' '.join(words)[:80]}': {needed} needed")
    return [int(word) for word in words[:count]]
