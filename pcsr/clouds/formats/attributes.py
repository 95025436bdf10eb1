"""Columns of text files beside the coordinates: their names and types, and notes on what was left out or guessed."""

from collections.abc import Mapping, Sequence

import numpy as np

from pcsr.clouds.columns import COLOURS, NORMALS, colour_names, unused
from pcsr.clouds.formats.column_names import standard_names
from pcsr.clouds.formats.guesses import guess_names
from pcsr.clouds.formats.table import Table


def name_columns(table: Table, names: Sequence[str]) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """Name the columns of a table.

    Colours and normals get their standard names: red, green, blue, alpha, nx, ny, nz. Without any names, colours and
    normals are guessed by their values.

    Args:
        table: numbers of the file, without the coordinates.
        names: names by index of column; empty where a column has none.

    Returns:
        Columns by name; the file's names of those that were renamed; and notes.
    """
    notes = _notes(table, names)
    rest = table.columns
    unnamed = not any(names[i] for i in rest if i < len(names))
    better, note = guess_names(rest) if unnamed else (standard_names(names), "")
    if note:
        notes.append(note)
    columns: dict[str, np.ndarray] = {}
    renamed: dict[str, str] = {}
    for i, column in rest.items():
        own = (names[i] if i < len(names) else "") or f"c{i}"
        name = unused(better.get(i, own), [*columns, "x", "y", "z"])
        if name != own and i in better:
            renamed[name] = own
        # Normals along the axes may be written as integers.
        columns[name] = column.astype(np.float64) if name.lower() in NORMALS else column
    blank = {name for i, name in better.items() if name in COLOURS and table.missing.get(i)}
    return _colours_in_bytes(_black(columns, blank, notes)), renamed, notes


def _black(columns: dict[str, np.ndarray], blank: set[str], notes: list[str]) -> dict[str, np.ndarray]:
    """Replace missing colours, from 0 to 255 or from 0 to 1, by 0."""
    there = np.concatenate([columns[name][~np.isnan(columns[name])] for name in blank]) if blank else np.zeros(0)
    if not len(there) or there.min() < 0:
        return columns
    in_bytes = bool((there == np.rint(there)).all()) and 1 < there.max() <= 255
    if not in_bytes and there.max() > 1:
        return columns
    notes.append("missing colours became black")
    kind = np.int64 if in_bytes else np.float64
    return {
        name: np.nan_to_num(column, nan=0).astype(kind) if name in blank else column for name, column in columns.items()
    }


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


def _notes(table: Table, names: Sequence[str]) -> list[str]:
    """Return sentences on what the table lacks."""
    count = table.count
    notes = []
    if table.words:
        example = next(iter(table.words.values()))[:40]
        notes.append(f"{_called(table.words, names)} not numbers, such as '{example}', and left out")
    if table.empty:
        notes.append(f"{_called(table.empty, names)} without any value and left out")
    if table.short:
        lines, low, high = table.short
        notes.append(f"{lines} of {count} lines have {low} columns instead of {high}: what they lack is NaN")
    elif table.missing:
        most = max(table.missing.values())
        most_of = f"{most} of {count}" if len(table.missing) == 1 else f"up to {most} of {count}"
        notes.append(f"{_called(table.missing, names)} without a value at {most_of} points: NaN there")
    return notes


def _called(indices: Mapping[int, object] | Sequence[int], names: Sequence[str]) -> str:
    """Return the names of columns as the subject of a sentence: "column 'a' is" or "columns 'a', 7 are"."""
    each = [f"'{names[i][:40]}'" if i < len(names) and names[i] else f"{i + 1}" for i in indices]
    shown = ", ".join(each[:5]) + (f" and {len(each) - 5} more" if len(each) > 5 else "")
    return f"column {shown} is" if len(each) == 1 else f"columns {shown} are"
