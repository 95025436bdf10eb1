"""Tables of numbers in text: fast where every word is plain, word by word where some are missing or no numbers."""

import re
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO, TextIOWrapper
from itertools import islice

import numpy as np

from pcsr.clouds.formats.missing import MISSING, is_number, number
from pcsr.clouds.formats.preamble import BETWEEN
from pcsr.clouds.formats.separators import COMMA, Layout
from pcsr.errors import UserError

INTEGER = re.compile(r"[+-]?\d{1,19}")
"""Word that may be a 64-bit integer."""
SPELLED = "S40"
"""Type of a column that is read as words and then converted."""
NEXT_KIND = {"i8": "f8", "f8": SPELLED}
"""Type by which a column is read if another fails."""
CHUNK = 1 << 18
"""Number of words that are converted at once."""
ATTEMPTS = 8
"""Number of attempts at reading all columns by NumPy, each with another type of a column."""


@dataclass
class Table:
    """Numbers of a text file, by index of column."""

    count: int
    """Number of points."""
    columns: dict[int, np.ndarray]
    """Columns of integers or doubles."""
    words: dict[int, str] = field(default_factory=dict)
    """Columns that are no numbers, each with one of its words."""
    empty: list[int] = field(default_factory=list)
    """Columns without any value."""
    missing: dict[int, int] = field(default_factory=dict)
    """Number of missing values, where there are any."""
    short: tuple[int, int, int] | None = None
    """Number of lines with fewer columns, their number of columns, and that of the others."""


@dataclass
class Rows:
    """Lines of numbers of a text file."""

    data: bytes
    """Text, with decimal points."""
    start: int
    """Index of the first byte of the first line."""
    line: int
    """Number of the first line."""
    layout: Layout
    """Separator of the columns."""
    coordinates: Sequence[int]
    """Indices of the columns x, y and z."""
    only: Sequence[int] | None = None
    """Indices of the columns to read; all by default. Lines may then differ in length."""

    def lines(self) -> TextIOWrapper:
        """Return the lines as a stream."""
        stream = BytesIO(self.data)
        stream.seek(self.start)
        return TextIOWrapper(stream, encoding="utf-8", errors="surrogateescape")

    def split(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the number and the words of each line that is not empty."""
        for at, line in enumerate(self.lines(), self.line):
            if line.strip():
                yield at, self.layout.split(line)


def read_table(rows: Rows, sample: Sequence[Sequence[str]]) -> Table:
    """Read a table of numbers.

    Columns whose values are all written as integers get an integer type. Columns of words are left out.

    Args:
        rows: the lines.
        sample: words of the first lines.

    Raises:
        UserError: a line is too short or too long, or a coordinate is no number.
    """
    width = len(sample[0])
    wanted = list(range(width)) if rows.only is None else sorted(rows.only)
    if width <= max(wanted) or any(len(row) != width for row in sample if rows.only is None):
        return _read_by_words(rows)
    kinds: dict[int, str] = {}
    for i in wanted:
        column = [row[i] for row in sample if len(row) > i]
        if i in rows.coordinates:
            kinds[i] = "f8"
        elif not any(column):
            kinds[i] = "empty"
        elif not all(map(is_number, column)):
            kinds[i] = "words"
        else:
            kinds[i] = "i8" if all(map(INTEGER.fullmatch, column)) else "f8"
    for _ in range(ATTEMPTS):
        try:
            table = _read_fast(rows, kinds)
            break
        except (ValueError, DeprecationWarning) as error:
            # A column may have an integer in the first rows, and another number or a gap further down.
            found = re.search(r"column (\d+)", str(error))
            at = int(found[1]) - 1 if found else -1
            if kinds.get(at) not in NEXT_KIND:
                return _read_by_words(rows)
            kinds[at] = NEXT_KIND[kinds[at]]
    else:
        return _read_by_words(rows)
    empty = [i for i, kind in kinds.items() if kind == "empty"]
    if any((table[f"{i}"] != "").any() for i in empty):
        return _read_by_words(rows)
    words = {i: next(row[i] for row in sample if not is_number(row[i])) for i, kind in kinds.items() if kind == "words"}
    columns = {i: np.ascontiguousarray(table[f"{i}"]) for i, kind in kinds.items() if kind in ("f8", "i8")}
    missing: dict[int, int] = {}
    for i in [i for i, kind in kinds.items() if kind == SPELLED]:
        try:
            columns[i], missing[i] = _spelled(table[f"{i}"])
        except ValueError:
            return _read_by_words(rows)
    columns = {i: columns[i] for i in sorted(columns)}
    gaps = {i: count for i, count in missing.items() if count and i not in rows.coordinates}
    return Table(len(table), columns, words, empty, gaps)


def _read_fast(rows: Rows, kinds: dict[int, str]) -> np.ndarray:
    """Read all columns by NumPy, which needs plain numbers."""
    # Of words, the first byte is enough: they are left out.
    fields = [(f"{i}", "U1" if kind in ("words", "empty") else kind) for i, kind in kinds.items()]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data", UserWarning)
        warnings.simplefilter("error", DeprecationWarning)  # of numbers such as 1.5 that are truncated to integers
        return np.loadtxt(
            rows.lines(),
            np.dtype(fields),
            comments=None,
            delimiter=rows.layout.separator,
            usecols=None if rows.only is None else list(kinds),
            ndmin=1,
            quotechar='"',
        )


def _spelled(column: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the values of a column of words, and the number of missing ones.

    Raises:
        ValueError: a word is no number, or too long for the column.
    """
    if (np.char.str_len(column) == column.dtype.itemsize).any():
        raise ValueError
    values, missing = np.zeros(len(column)), 0
    for start in range(0, len(column), CHUNK):
        words = [word.decode("ascii").strip() for word in column[start : start + CHUNK].tolist()]
        values[start : start + CHUNK] = list(map(number, words))
        missing += sum(word.lower() in MISSING for word in words)
    return values, missing


def _read_by_words(rows: Rows) -> Table:
    """Read a table word by word: slow, but every notation of numbers is accepted and errors name the line."""
    width, short = _width(rows)
    wanted = list(range(width)) if rows.only is None else sorted(rows.only)
    parts: dict[int, list[np.ndarray]] = {i: [] for i in wanted}
    words: dict[int, str] = {}
    missing: Counter[int] = Counter()
    split = rows.split()
    while chunk := list(islice(split, max(1, CHUNK // width))):
        for i in wanted:
            if i not in words:
                column = [row[i] if i < len(row) else "" for _, row in chunk]
                try:
                    parts[i].append(_column(column))
                except ValueError:
                    line, word = next((at, word) for (at, _), word in zip(chunk, column, strict=True) if _wrong(word))
                    if i in rows.coordinates:
                        raise UserError(_no_number(rows, line, i, word)) from None
                    words[i] = word
                    continue
                if np.isnan(parts[i][-1]).any():
                    missing[i] += sum(word.lower() in MISSING for word in column)
    columns = {i: np.concatenate(part) for i, part in parts.items() if i not in words}
    count = len(columns[rows.coordinates[0]])
    empty = [i for i in columns if missing[i] == count and i not in rows.coordinates]
    kept = {i: column for i, column in columns.items() if i not in empty}
    gaps = {i: missing[i] for i in kept if missing[i] and i not in rows.coordinates}
    return Table(count, kept, words, empty, gaps, short)


def _width(rows: Rows) -> tuple[int, tuple[int, int, int] | None]:
    """Return the number of columns, and which lines have fewer.

    Raises:
        UserError: lines differ in length otherwise than by columns that are missing at the end of several.
    """
    widths: Counter[int] = Counter()
    first: dict[int, int] = {}
    needed = max(rows.coordinates if rows.only is None else rows.only) + 1
    filled = 0
    for at, row in rows.split():
        if len(row) < needed:
            raise UserError(f"line {at} has {len(row)} columns, at least {needed} are needed")
        widths[len(row)] += 1
        first.setdefault(len(row), at)
        while len(row) > filled and not row[-1]:
            row.pop()
        filled = max(filled, len(row))
    high = max(widths)
    short = [width for width in widths if width < filled]
    if rows.only is not None or not short:
        return high, None
    if len(widths) == 2 and min(widths.values()) > 1 and not rows.layout.commas_too:
        return high, (widths[short[0]], short[0], high)
    usual, odd = list(first)[:2]
    raise UserError(f"line {first[odd]} has {odd} columns, the first has {usual}")


def _column(words: Sequence[str]) -> np.ndarray:
    if all(map(INTEGER.fullmatch, words)):
        try:
            return np.array(list(map(int, words)), np.int64)
        except OverflowError:
            pass
    try:
        if "_" not in "".join(words):
            return np.array(list(map(float, words)), np.float64)
    except ValueError:
        pass
    return np.array(list(map(number, words)), np.float64)


def _wrong(word: str) -> bool:
    return not is_number(word)


def _no_number(rows: Rows, line: int, column: int, word: str) -> str:
    axis = "xyz"[list(rows.coordinates).index(column)]
    if COMMA.fullmatch(word):
        remedy = "write decimal points, not commas"
    elif len(BETWEEN.split(word)) > 1:
        remedy = "separate all columns as in the first lines"
    elif line > rows.line:
        remedy = "correct or remove the line"
    else:
        remedy = "say which columns are x, y and z by --columns -,x,y,z"
    return f"line {line}, column {column + 1} ({axis}): '{word[:80]}' is no number: {remedy}"
