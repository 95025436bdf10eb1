"""XYZ, TXT and CSV: a point on each line, with or without a line of column names; all columns are kept."""

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
"""Line that is a comment."""
DECIMAL_COMMAS = re.compile(r"\A\s*[+-]?\d+,\d+(?:[ \t;]+[+-]?\d+,\d+)+[ \t]*$", re.MULTILINE)
"""First line of numbers with decimal commas, separated by spaces or semicolons."""
INTEGER = re.compile(r"[+-]?\d{1,19}")
"""Word that may be a 64-bit integer."""


def read_xyz(data: bytes) -> Cloud:
    """Read numbers separated by white space or commas.

    If the file does not name columns x, y and z, the first three columns are the coordinates.
    """
    return _read(data, comma=False, all_columns=True)


def read_csv(data: bytes) -> Cloud:
    """Read numbers separated by commas; names of columns, if there are any, must include x, y and z."""
    return _read(data, comma=True, all_columns=True)


def xyz_points(data: bytes) -> np.ndarray:
    """Read the coordinates as `read_xyz` does; other columns need not be numbers."""
    return _read(data, comma=False, all_columns=False).points


def csv_points(data: bytes) -> np.ndarray:
    """Read the coordinates as `read_csv` does; other columns need not be numbers."""
    return _read(data, comma=True, all_columns=False).points


def _read(data: bytes, *, comma: bool, all_columns: bool) -> Cloud:
    check_lines(data)
    text = data.decode("utf-8-sig")
    bare = COMMENT.sub("", text) if "#" in text or "//" in text else text
    if not comma and DECIMAL_COMMAS.search(bare):
        raise UserError("it has decimal commas, 1,5 for 1.5: write decimal points, since commas separate columns here")
    rows = _split(bare.lstrip(), comma)
    _, first = next(rows, (0, []))
    names = _names(first)
    width = len((next(rows, (0, first)) if names else (0, first))[1])
    if max(width, len(names)) > MOST_COLUMNS:
        raise UserError(f"it has {max(width, len(names))} columns, and {MOST_COLUMNS} are the most: remove some")
    coordinates = _coordinates(names, must=comma) if names else [0, 1, 2]
    if all_columns and names and width != len(names) and first:
        raise UserError(f"its line of names has {len(names)} columns, the line after it has {width}")
    known = names or (_names_in_comment(text, width) if all_columns else [])
    if known and not names:
        coordinates = _coordinates(known, must=False)
    table = _numbers(text, bare, comma, bool(names), width if all_columns else None, coordinates)
    if not len(table):
        raise UserError("it holds no points")
    points = np.stack([np.asarray(table[f"{i}"], np.float64) for i in coordinates], axis=-1)
    columns: dict[str, np.ndarray] = {}
    for i in range(width if all_columns else 0):
        if i not in coordinates:
            name = unused((known[i] if known else "") or f"c{i}", [*columns, "x", "y", "z"])
            column = np.ascontiguousarray(table[f"{i}"])
            # Normals along the axes may be written as integers.
            columns[name] = column.astype(np.float64) if name.lower() in NORMALS else column
    return Cloud(points, _colours_in_bytes(columns), {"text": {"header": bool(names)}})


def _colours_in_bytes(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert integer colours to 8 or 16 bits if all are up to 255 or 65535, as in binary formats."""
    colours = colour_names(columns)
    if not colours or any(columns[name].dtype.kind != "i" for name in colours):
        return columns
    if min(columns[name].min() for name in colours) < 0:
        return columns
    highest = max(columns[name].max() for name in colours)
    kind = np.uint8 if highest < 2**8 else np.uint16 if highest < 2**16 else np.int64
    return {name: column.astype(kind) if name in colours else column for name, column in columns.items()}


def _split(text: str, comma: bool) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line that is neither empty nor a comment."""
    for number, line in enumerate(StringIO(text, newline=None), 1):
        line = line.strip()
        if line and not line.startswith(("#", "//")):
            if comma:
                yield number, [word.strip() for word in next(csv.reader([line], skipinitialspace=True))]
            else:
                yield number, line.replace(",", " ").split()


def _names(row: list[str]) -> list[str]:
    """Return the row if it consists of column names, otherwise nothing."""
    words = {word.lower() for word in row}
    return row if words >= {"x", "y", "z"} or not any(map(_is_number, row)) else []


def _names_in_comment(text: str, width: int) -> list[str]:
    """Return the column names in a first line such as CloudCompare's "//X Y Z R G B", otherwise nothing."""
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
    """Read the table of numbers, whose fields are named by the index of their column.

    Columns whose values are all written as integers get an integer type.

    Args:
        text: the whole file.
        bare: the file without comments.
        comma: whether only commas separate columns.
        named: whether the first line holds column names.
        width: number of columns; None to read the coordinates only.
        coordinates: indices of the columns of the coordinates.
    """
    bare = bare.lstrip()
    if named:
        bare = bare.partition("\n")[2] if "\n" in bare else bare.partition("\r")[2]
    if not comma:
        bare = bare.replace(",", " ")
    wanted = sorted(coordinates) if width is None else list(range(width))
    if width is not None and width < 3:
        wanted = [0, 1, 2]  # too few columns: `_read_by_words` raises an error that names the line
    integers = _integers(bare, comma) & set(wanted).difference(coordinates)
    while True:
        kinds = [(f"{i}", "i8" if i in integers else "f8") for i in wanted]
        try:
            return _read_by_numpy(bare, kinds, "," if comma else None, wanted if width is None else None)
        except (ValueError, DeprecationWarning) as error:
            if not integers:
                return _read_by_words(_split(text, comma), named, width, wanted)
            # A column has an integer in the first row and another number further down.
            found = re.search(r"column (\d+)", str(error))
            integers = integers - {int(found[1]) - 1} if found and int(found[1]) - 1 in integers else set()


def _read_by_numpy(
    text: str, kinds: list[tuple[str, str]], separator: str | None, only: list[int] | None
) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data", UserWarning)
        warnings.simplefilter("error", DeprecationWarning)  # of numbers such as 1.5 that are truncated to integers
        rows = StringIO(text, newline=None)
        return np.loadtxt(
            rows, np.dtype(kinds), comments=None, delimiter=separator, usecols=only, ndmin=1, quotechar='"'
        )


def _integers(text: str, comma: bool) -> set[int]:
    """Return the indices of the columns that have an integer in the first row."""
    row = next((row for _, row in _split(text, comma)), [])
    return {i for i, word in enumerate(row) if INTEGER.fullmatch(word)}


def _read_by_words(
    rows: Iterable[tuple[int, list[str]]], named: bool, width: int | None, wanted: list[int]
) -> np.ndarray:
    """Read the table word by word: slow, but every notation of numbers is accepted and errors name the line.

    Raises:
        UserError: a line is too short or too long, or a word is no number.
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
    """Write numbers separated by spaces.

    Column names are written to the first line if the file that was read had them, or if names would be lost.
    """
    columns = one_word_names(spread(cloud.columns, rest=True))
    return _write(cloud, columns, " ", cloud.about.get("text", {}).get("header", False))


def write_csv(cloud: Cloud) -> bytes:
    """Write numbers separated by commas.

    Column names are written to the first line, unless the file that was read had none and no name would be lost.
    """
    columns = one_word_names(spread(cloud.columns, rest=True))
    return _write(cloud, columns, ",", cloud.about.get("text", {}).get("header", True))


def _write(cloud: Cloud, columns: dict[str, np.ndarray], separator: str, header: bool) -> bytes:
    names = [*"xyz", *columns]
    header = header or any(name != f"c{i}" for i, name in enumerate(names[3:], 3))
    head = separator.join(names) + "\n" if header else ""
    table = [*cloud.points.T, *columns.values()]
    return (head + "".join(separator.join(row) + "\n" for row in zip(*map(words, table), strict=True))).encode()
