"""Numbers as text: reading rows of numbers, and writing numbers with the fewest digits."""

import warnings
from array import array
from io import StringIO

import numpy as np

from pcsr.clouds.formats.missing import number
from pcsr.errors import UserError
from pcsr.limits import LONGEST_LINE

MANY_LINES = 10**6
"""Texts of more lines than this are refused if nearly all of them are empty."""


def check_lines(data: bytes, start: int = 0) -> None:
    """Check that text may contain a point on each line.

    Args:
        data: file with the text.
        start: index at which the text begins.

    Raises:
        UserError: a line is longer than `LONGEST_LINE`, or nearly all lines of a long text are empty.
    """
    newline = b"\n" if b"\n" in data[start : start + LONGEST_LINE] else b"\r"
    at = start
    while len(data) - at > LONGEST_LINE:
        end = data.rfind(newline, at, at + LONGEST_LINE)
        if end < 0:
            raise UserError(
                f"at byte {at} begins a line of more than {LONGEST_LINE} bytes, the most that is allowed: it is no "
                f"text with a point on each line"
            )
        at = end + 1
    lines = data.count(newline, start)
    if lines > MANY_LINES and len(data) - start < 3 * lines:
        raise UserError(f"it has {lines} lines, nearly all of them empty: remove the empty ones")


def load_rows(text: str, count: int | None = None) -> np.ndarray:
    """Read rows of numbers separated by white space, all of the same length.

    Args:
        text: the text.
        count: largest number of rows to read; all by default.

    Raises:
        UserError: rows differ in length, or a word is no number.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of no rows and of empty lines
        try:
            return np.loadtxt(StringIO(text, newline=None), np.float64, comments=None, ndmin=2, max_rows=count)
        except ValueError:  # 1.#QNAN and the like are left to Python
            return _load_spelled(text, count)


def _load_spelled(text: str, count: int | None) -> np.ndarray:
    """Read rows as `load_rows` does, with every spelling of numbers that are not finite."""
    values, width, at = array("d"), 0, 0
    for row in map(str.split, StringIO(text, newline=None)):
        if at == count:
            break
        if not row:
            continue
        at, width = at + 1, width or len(row)
        if len(row) != width:
            raise UserError(
                f"its rows of numbers cannot be read: row {at} has {len(row)} numbers and the first has {width}: it "
                f"is cut off or damaged"
            )
        for word in row:
            try:
                values.append(number(word))
            except ValueError:
                remedy = "write decimal points, not commas" if "," in word else "it is damaged"
                raise UserError(
                    f"its rows of numbers cannot be read: '{word[:80]}' in row {at} is no number: {remedy}"
                ) from None
    return np.array(values).reshape(-1, width or 1)


def cast_column(column: np.ndarray, kind: np.dtype, name: str) -> np.ndarray:
    """Convert a column to another type.

    Raises:
        UserError: the type is an integer type that cannot represent a value of the column.
    """
    if kind.kind not in "iu" or column.dtype == kind:
        return column.astype(kind, copy=False)
    with np.errstate(invalid="ignore"):
        cast = column.astype(kind)
    bad = np.flatnonzero((cast != column).reshape(len(column), -1).any(axis=1))
    if len(bad):
        raise UserError(f"'{name}' holds {column[bad[0]]} at point {bad[0]}, which is no {kind}")
    return cast


def words(column: np.ndarray) -> list[str]:
    """Format numbers with the fewest digits that read back as the same value of the column's type."""
    if column.dtype.kind == "b":
        column = column.astype(np.uint8)
    if column.dtype.kind == "f" and column.dtype.itemsize < 8:
        shortest: list[str] = column.astype("U32").tolist()
        return shortest
    return list(map(repr, column.astype(np.float64).tolist() if column.dtype.kind == "f" else column.tolist()))
