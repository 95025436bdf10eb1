"""Numbers as text: reading rows of numbers, and writing numbers with the fewest digits."""

import re
import warnings
from io import StringIO

import numpy as np

from pcsr.errors import UserError
from pcsr.limits import LONGEST_LINE

MANY_LINES = 10**6
"""Texts of more lines than this are refused if nearly all of them are empty."""

WINDOWS = re.compile(r"([+-]?)(?:nan\(\w*\)|1\.#(\w+))", re.IGNORECASE)
"""Words by which C libraries of Windows write numbers that are not finite: -nan(ind), 1.#QNAN, -1.#INF."""


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
        except ValueError as error:
            plain = WINDOWS.sub(_not_finite, text)
            if plain != text:
                return load_rows(plain, count)
            raise UserError(f"its rows of numbers cannot be read: {_explanation(text)}") from error


def as_number(word: str) -> float | None:
    """Return the number that a word writes, or None if it writes none."""
    try:
        return float(WINDOWS.sub(_not_finite, word))
    except ValueError:
        return None


def _not_finite(found: re.Match[str]) -> str:
    return f"{found[1]}inf" if found[2] and found[2].upper().startswith("INF") else "nan"


def _explanation(text: str) -> str:
    """Say what is wrong with the first row that has another length than the first one or a word that is no number."""
    first = 0
    for number, row in enumerate((row for line in text.splitlines() if (row := line.split())), 1):
        first = first or len(row)
        if len(row) != first:
            return f"row {number} has {len(row)} numbers and the first has {first}: it is cut off or damaged"
        for word in row:
            if as_number(word) is None:
                return f"row {number} has '{word[:40]}', which is no number"
    return "one of their numbers has a form that is not known"


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
