"""Numbers as text, for the formats that have text in them: rows of doubles, and the shortest digits."""

import warnings
from io import StringIO

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import LONGEST_LINE

MANY = 10**6
"""From so many lines on, text of little but empty ones is refused."""


def check_lines(data: bytes, start: int = 0) -> None:
    """Refuse text with a line that is longer than any row of numbers, or of hardly anything but empty lines.

    Args:
        data: the text.
        start: where it begins.

    Raises:
        UserError: there is such a line, or there are so many.
    """
    gap = b"\n" if b"\n" in data[start : start + LONGEST_LINE] else b"\r"
    at = start
    while len(data) - at > LONGEST_LINE:
        end = data.rfind(gap, at, at + LONGEST_LINE)
        if end < 0:
            raise UserError(
                f"its byte {at} begins a line of more than {LONGEST_LINE} bytes, and none may be longer: it is no text "
                f"with a point on each line"
            )
        at = end + 1
    lines = data.count(gap, start)
    if lines > MANY and len(data) - start < 3 * lines:
        raise UserError(f"it has {lines} lines, nearly all of them empty: remove the empty ones")


def load_rows(text: str, count: int | None = None) -> np.ndarray:
    """Rows of doubles parted by white space, all of one width; at most `count` of them.

    Raises:
        UserError: rows of different widths, or something else than numbers.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no rows at all, or empty lines among them
        try:
            return np.loadtxt(StringIO(text, newline=None), np.float64, comments=None, ndmin=2, max_rows=count)
        except ValueError as error:
            raise UserError(f"its rows of numbers cannot be read: {_why(text, str(error))}") from error


def _why(text: str, reason: str) -> str:
    """What is wrong with rows of numbers, where it is that they are of different widths."""
    rows = (line.split() for line in text.splitlines())
    first = next((row for row in rows if row), [])
    for number, row in enumerate((row for row in rows if row), 2):
        if len(row) != len(first):
            return f"row {number} has {len(row)} numbers and the first has {len(first)}: it is cut off or damaged"
    return reason


def fitting(column: np.ndarray, kind: np.dtype, name: str) -> np.ndarray:
    """The column in another type.

    Raises:
        UserError: the type is one of integers, and the column holds something else.
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
    """The shortest digits that read back as the same number of the column's type."""
    if column.dtype.kind == "b":
        column = column.astype(np.uint8)
    if column.dtype.kind == "f" and column.dtype.itemsize < 8:
        shortest: list[str] = column.astype("U32").tolist()
        return shortest
    return list(map(repr, column.astype(np.float64).tolist() if column.dtype.kind == "f" else column.tolist()))
