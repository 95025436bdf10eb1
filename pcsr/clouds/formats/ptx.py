"""PTX files of Leica scanners: grids of points in the frame of the scanner, each with its pose."""

import numpy as np
from jaxtyping import Float64, Int

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats.attributes import name_columns
from pcsr.clouds.formats.digits import check_lines
from pcsr.clouds.formats.encodings import as_utf8
from pcsr.clouds.formats.missing import is_number, number
from pcsr.clouds.formats.separators import Layout
from pcsr.clouds.formats.table import Rows, read_table
from pcsr.errors import UserError
from pcsr.limits import MOST_COLUMNS

NAMES = ("x", "y", "z", "intensity", "red", "green", "blue")
"""Names of the columns, of which the first 3, the first 4 or all are there."""
HEADER = (
    ("number of columns", 1),
    ("number of rows", 1),
    ("position of the scanner", 3),
    *[("axis of the scanner", 3)] * 3,
    *[("row of the transformation", 4)] * 4,
)
"""Meaning and count of the numbers on each line of a header."""
SAMPLE = 200
"""Number of lines by which the columns are recognised."""


def read_ptx(data: bytes) -> Cloud:
    """Read one or several scans into their common frame, by the transformations in their headers.

    Pixels without a point, 0 0 0 or not finite, are left out.

    Raises:
        UserError: a header is damaged, or the file is cut off.
    """
    check_lines(data)
    data, notes = as_utf8(data)
    if b"," in data:  # nothing else in the format has commas
        data = data.replace(b",", b".")
        notes.append("its commas were read as decimal points")
    if not data.endswith(b"\n"):
        data += b"\n"
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n")) + 1
    points, columns, empty, moved, at = [], [], 0, False, 0
    while (at := _skip_empty(data, ends, at)) < len(ends):
        count, matrix = _header(data, ends, at)
        at += len(HEADER)
        if count > len(ends) - at:
            raise UserError(f"it is cut off: {len(ends) - at} of {count} points are there from line {at + 1} on")
        if count:
            local, attributes, more = _scan(data[ends[at - 1] : ends[at + count - 1]], at + 1)
            there = np.isfinite(local).all(axis=1) & local.any(axis=1)
            empty += count - int(there.sum())
            moved |= bool((matrix != np.eye(4)).any())
            points.append(local[there] @ matrix[:3, :3] + matrix[3, :3] if moved else local[there])
            columns.append({name: column[there] for name, column in attributes.items()})
            notes += [note for note in more if note not in notes]
        at += count
    if not sum(map(len, points)):
        raise UserError("it holds no points")
    common = [name for name in columns[0] if all(name in each for each in columns)]
    if missing := sorted({name for each in columns for name in each}.difference(common)):
        notes.append(f"not all of its scans have {', '.join(missing)}, which is left out")
    if empty:
        notes.append(f"{empty} of {empty + sum(map(len, points))} pixels have no point (0 0 0) and are left out")
    if moved:
        notes.append("its points are in the common frame, by the transformations in its headers")
    merged = {name: np.concatenate([each[name] for each in columns]) for name in common}
    return Cloud(np.concatenate(points), merged, {"notes": tuple(notes)})


def _line(data: bytes, ends: Int[np.ndarray, " lines"], at: int) -> str:
    return data[ends[at - 1] if at else 0 : ends[at]].decode("utf-8", "replace").strip()


def _skip_empty(data: bytes, ends: Int[np.ndarray, " lines"], at: int) -> int:
    while at < len(ends) and not _line(data, ends, at):
        at += 1
    return at


def _header(data: bytes, ends: Int[np.ndarray, " lines"], at: int) -> tuple[int, Float64[np.ndarray, "4 4"]]:
    """Read the header that begins at a line; return the number of points and the transformation of row vectors."""
    numbers: list[list[float]] = []
    for i, (meaning, length) in enumerate(HEADER, at):
        words = _line(data, ends, i).split() if i < len(ends) else []
        if len(words) != length or not all(map(is_number, words)):
            shown = " ".join(words)[:60]
            raise UserError(f"line {i + 1} of the file should be the {meaning}, {length} numbers, and is '{shown}'")
        numbers.append([number(word) for word in words])
    size = np.array(numbers[0] + numbers[1])
    if not (np.isfinite(size).all() and (size == np.rint(size)).all() and (size >= 0).all() and size.max() < 2**31):
        raise UserError(f"lines {at + 1} and {at + 2} hold {size[0]:g} and {size[1]:g}, no numbers of columns and rows")
    matrix = np.array(numbers[6:])
    if not np.isfinite(matrix).all() or np.linalg.matrix_rank(matrix[:3, :3]) < 3:
        raise UserError(f"the transformation in lines {at + 7} to {at + 10} is not invertible: correct it")
    if matrix[:3, 3].any() and (matrix[3] == (0, 0, 0, 1)).all():
        matrix = matrix.T  # some programs write the transformation of column vectors
    if (matrix[:, 3] != (0, 0, 0, 1)).any():
        raise UserError(f"the rows of the transformation in lines {at + 7} to {at + 10} do not end in 0, 0, 0 and 1")
    return int(size[0] * size[1]), matrix


def _scan(data: bytes, line: int) -> tuple[Float64[np.ndarray, "n 3"], dict[str, np.ndarray], list[str]]:
    """Read the points of a scan whose first line has a number; return points, columns and notes."""
    layout = Layout(None)
    sample = [layout.split(each.decode("utf-8", "replace")) for each in data.split(b"\n", SAMPLE)[:-1]]
    sample = [row for row in sample if row]
    if not sample or len(sample[0]) < 3:
        raise UserError(f"line {line} should be a point: x, y, z and its intensity")
    if (width := max(map(len, sample))) > MOST_COLUMNS:
        raise UserError(f"it has {width} columns, and {MOST_COLUMNS} are the most: remove some")
    table = read_table(Rows(data, 0, line, layout, [0, 1, 2]), sample)
    points = np.stack([np.asarray(table.columns.pop(i), np.float64) for i in range(3)], axis=-1)
    columns, _, notes = name_columns(table, NAMES)
    return points, columns, notes
