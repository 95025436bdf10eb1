"""XYZ, TXT and CSV: a point on each line, with or without a line of names; columns beyond x, y and z are kept."""

import csv
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from io import StringIO

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import NORMALS, colour_names, one_word_names, spread, unused
from pcsr.clouds.formats.digits import check_lines, words
from pcsr.errors import UserError
from pcsr.limits import MOST_COLUMNS

COMMENT = re.compile(r"^[ \t]*(?:#|//).*$", re.MULTILINE)
DECIMAL_COMMAS = re.compile(r"\A\s*[+-]?\d+,\d+(?:[ \t;]+[+-]?\d+,\d+)+[ \t]*$", re.MULTILINE)
"""A first line of numbers with commas inside that are parted by spaces: nobody means these commas to part columns."""
INTEGER = re.compile(r"[+-]?\d{1,19}")
"""What may be an integer of 64 bits."""


def read_xyz(data: bytes) -> Cloud:
    """Numbers parted by white space or commas; names of the coordinates are taken to be x, y and z."""
    return _read(data, comma=False, beside=True)


def read_csv(data: bytes) -> Cloud:
    """Numbers parted by commas; names must include x, y and z."""
    return _read(data, comma=True, beside=True)


def xyz_points(data: bytes) -> np.ndarray:
    """The coordinates alone: what is beside them need not be numbers."""
    return _read(data, comma=False, beside=False).points


def csv_points(data: bytes) -> np.ndarray:
    """The coordinates alone: what is beside them need not be numbers."""
    return _read(data, comma=True, beside=False).points


def _read(data: bytes, *, comma: bool, beside: bool) -> Cloud:
    check_lines(data)
    text = data.decode("utf-8-sig")
    bare = COMMENT.sub("", text) if "#" in text or "//" in text else text
    if not comma and DECIMAL_COMMAS.search(bare):
        raise UserError("it has decimal commas, 1,5 for 1.5: write points, as commas part columns here")
    rows = _split(bare.lstrip(), comma)
    _, first = next(rows, (0, []))
    names = _names(first)
    width = len((next(rows, (0, first)) if names else (0, first))[1])
    if max(width, len(names)) > MOST_COLUMNS:
        raise UserError(f"it has {max(width, len(names))} columns, and {MOST_COLUMNS} are the most")
    coordinates = _coordinates(names, must=comma) if names else [0, 1, 2]
    if beside and names and width != len(names) and first:
        raise UserError(f"its line of names has {len(names)} columns, the line after it has {width}")
    named = names or (_commented(text, width) if beside else [])
    if named and not names:
        coordinates = _coordinates(named, must=False)
    table = _numbers(text, bare, comma, bool(names), width if beside else None, coordinates)
    if not len(table):
        raise UserError("it holds no points")
    points = np.stack([np.asarray(table[f"{i}"], np.float64) for i in coordinates], axis=-1)
    columns: dict[str, np.ndarray] = {}
    for i in range(width if beside else 0):
        if i not in coordinates:
            name = unused((named[i] if named else "") or f"c{i}", [*columns, "x", "y", "z"])
            column = np.ascontiguousarray(table[f"{i}"])
            # Normals along the axes may be written without a point.
            columns[name] = column.astype(np.float64) if name.lower() in NORMALS else column
    return Cloud(points, _colours_in_bytes(columns), {"text": {"header": bool(names)}})


def _colours_in_bytes(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Whole colours from 0 to 255 take 8 bits, those to 65535 take 16, as binary formats have them."""
    colours = colour_names(columns)
    if not colours or any(columns[name].dtype.kind != "i" for name in colours):
        return columns
    if min(columns[name].min() for name in colours) < 0:
        return columns
    highest = max(columns[name].max() for name in colours)
    kind = np.uint8 if highest < 2**8 else np.uint16 if highest < 2**16 else np.int64
    return {name: column.astype(kind) if name in colours else column for name, column in columns.items()}


def _split(text: str, comma: bool) -> Iterator[tuple[int, list[str]]]:
    """The words of the lines that are neither empty nor a comment, with the lines' numbers."""
    for number, line in enumerate(StringIO(text, newline=None), 1):
        line = line.strip()
        if line and not line.startswith(("#", "//")):
            if comma:
                yield number, [word.strip() for word in next(csv.reader([line], skipinitialspace=True))]
            else:
                yield number, line.replace(",", " ").split()


def _names(row: list[str]) -> list[str]:
    """The row itself where it is a line of names."""
    words = {word.lower() for word in row}
    return row if words >= {"x", "y", "z"} or not any(map(_is_number, row)) else []


def _commented(text: str, width: int) -> list[str]:
    """Names in a comment that comes first, as CloudCompare has them: //X Y Z R G B."""
    first = text.lstrip().split("\n", 1)[0]
    names = first.lstrip("#/ \t").replace(",", " ").split() if COMMENT.match(first) else []
    return names if len(names) == width and {"x", "y", "z"} <= {name.lower() for name in names} else []


def _coordinates(names: list[str], must: bool) -> list[int]:
    lower = [name.lower() for name in names]
    if all(axis in lower for axis in "xyz"):
        return [lower.index(axis) for axis in "xyz"]
    if must:
        raise UserError(f"its columns are {', '.join(lower)[:200]}: name those of the coordinates x, y and z")
    return [0, 1, 2]


def _numbers(text: str, bare: str, comma: bool, named: bool, width: int | None, coordinates: list[int]) -> np.ndarray:
    """The table of numbers; its fields are called by the number of their column.

    Columns whose values are all written as integers are integers.

    Args:
        text: the whole file.
        bare: the same without comments.
        comma: whether commas alone part the columns.
        named: whether the first line holds names.
        width: how many columns there are; None to read the coordinates alone.
        coordinates: the columns that hold them.
    """
    bare = bare.lstrip()
    if named:
        bare = bare.partition("\n")[2] if "\n" in bare else bare.partition("\r")[2]
    if not comma:
        bare = bare.replace(",", " ")
    wanted = sorted(coordinates) if width is None else list(range(width))
    if width is not None and width < 3:
        wanted = [0, 1, 2]  # too few: the careful reading names the line
    integers = _integers(bare, comma) & set(wanted).difference(coordinates)
    while True:
        kinds = [(f"{i}", "i8" if i in integers else "f8") for i in wanted]
        try:
            return _quick(bare, kinds, "," if comma else None, wanted if width is None else None)
        except (ValueError, DeprecationWarning) as error:
            if not integers:
                return _careful(_split(text, comma), named, width, wanted)
            # One column holds an integer in the first row and something else further down.
            column = re.search(r"column (\d+)", str(error))
            integers = integers - {int(column[1]) - 1} if column and int(column[1]) - 1 in integers else set()


def _quick(text: str, kinds: list[tuple[str, str]], gap: str | None, only: list[int] | None) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data", UserWarning)
        warnings.simplefilter("error", DeprecationWarning)  # numbers such as 1.5 that are cut to fit an integer
        rows = StringIO(text, newline=None)
        return np.loadtxt(rows, np.dtype(kinds), comments=None, delimiter=gap, usecols=only, ndmin=1, quotechar='"')


def _integers(text: str, comma: bool) -> set[int]:
    """The columns that hold an integer in the first row."""
    row = next((row for _, row in _split(text, comma)), [])
    return {i for i, word in enumerate(row) if INTEGER.fullmatch(word)}


def _careful(rows: Iterable[tuple[int, list[str]]], named: bool, width: int | None, wanted: list[int]) -> np.ndarray:
    """The same, a word at a time: slow, but it takes every way of writing a number and names the line at fault.

    Raises:
        UserError: a line is too short or too long, or holds something else than numbers.
    """
    found: list[list[str]] = []
    for at, (number, row) in enumerate(rows):
        if at == 0 and named:
            continue
        if len(row) <= max(wanted):
            raise UserError(f"line {number} has {len(row)} columns, at least {max(wanted) + 1} are needed")
        if width is not None and len(row) != width:
            raise UserError(f"line {number} has {len(row)} columns, the first has {width}")
        found.append([row[i] for i in wanted])
        try:
            list(map(float, found[-1]))
        except ValueError as error:
            raise UserError(f"line {number}: {str(error)[:120]}") from error
    columns = [_column(each) for each in zip(*found, strict=True)] or [np.zeros(0) for _ in wanted]
    table = np.zeros(len(found), [(f"{i}", column.dtype) for i, column in zip(wanted, columns, strict=True)])
    for i, column in zip(wanted, columns, strict=True):
        table[f"{i}"] = column
    return table


def _column(row: Sequence[str]) -> np.ndarray:
    if all(map(INTEGER.fullmatch, row)):
        with suppress(OverflowError):
            return np.array(list(map(int, row)), np.int64)
    return np.array(list(map(float, row)))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def write_xyz(cloud: Cloud) -> bytes:
    """Numbers parted by spaces, below a line of names where there was one or names would be lost."""
    columns = one_word_names(spread(cloud.columns, rest=True))
    return _write(cloud, columns, " ", cloud.about.get("text", {}).get("header", False))


def write_csv(cloud: Cloud) -> bytes:
    """Numbers parted by commas, below a line of names unless there was none and none would be lost."""
    columns = one_word_names(spread(cloud.columns, rest=True))
    return _write(cloud, columns, ",", cloud.about.get("text", {}).get("header", True))


def _write(cloud: Cloud, columns: dict[str, np.ndarray], gap: str, header: bool) -> bytes:
    names = [*"xyz", *columns]
    header = header or any(name != f"c{i}" for i, name in enumerate(names[3:], 3))
    head = gap.join(names) + "\n" if header else ""
    table = [*cloud.points.T, *columns.values()]
    return (head + "".join(gap.join(row) + "\n" for row in zip(*map(words, table), strict=True))).encode()
