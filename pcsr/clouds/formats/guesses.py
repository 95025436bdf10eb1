"""Guesses at the meaning of columns without names: colours and normals, by their values."""

from collections.abc import Mapping, Sequence

import numpy as np

from pcsr.clouds.columns import COLOURS, NORMALS

LEAST = 6
"""Columns that a file without names must have for a guess, the coordinates included."""
UNIT = 0.01
"""Most that the length of a normal differs from 1."""


def guess_names(columns: Mapping[int, np.ndarray]) -> tuple[dict[int, str], str]:
    """Guess which columns hold colours and normals.

    Colours are three successive columns of integers from 0 to 255, or four of which the last is 255 throughout. Longer
    runs of such columns may be labels too and are not guessed. Normals are three successive columns of length 1 at each
    point, or 0 where a normal is unknown.

    Args:
        columns: columns by index, without the coordinates.

    Returns:
        Names by index, and a note for the user; both empty for fewer columns than `LEAST`.
    """
    if len(columns) < LEAST - 3:
        return {}, ""
    names: dict[int, str] = {}
    for run in _runs(list(columns)):
        while len(run) >= 3 and not names:
            if _are_normals([columns[i] for i in run[:3]]):
                names |= dict(zip(run[:3], NORMALS, strict=True))
            run = run[1:]
    for run in _runs([i for i, column in columns.items() if i not in names and _is_byte(column)]):
        block = [columns[i] for i in run]
        opaque = len(run) == 4 and bool((block[3] == 255).all())
        if (len(run) == 3 or opaque) and max(np.nanmax(column) for column in block[:3]) > 1:
            names |= dict(zip(run, COLOURS, strict=False))
    if not names:
        return {}, (
            "its columns have no names, and which are colours or normals is not clear: name them by --columns x,y,z,…"
        )
    found = []
    for group, what in ((COLOURS, "colours"), (NORMALS, "normals")):
        numbers = [i + 1 for i, name in names.items() if name in group]
        if numbers:
            found.append(f"columns {numbers[0]} to {numbers[-1]} were taken for {what}")
    return names, f"its {' and '.join(found)}, by their values: if they are not, name them by --columns x,y,z,…"


def _runs(indices: Sequence[int]) -> list[list[int]]:
    """Split indices into runs of successive ones."""
    runs: list[list[int]] = []
    for index in indices:
        if runs and runs[-1][-1] == index - 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    return runs


def _is_byte(column: np.ndarray) -> bool:
    """Return whether a column holds integers from 0 to 255, and NaN at most where it has gaps."""
    if column.dtype.kind == "f":
        gaps = np.isnan(column)
        there = column[~gaps]
        if not gaps.any() or not len(there) or (there != np.rint(there)).any():
            return False
        column = there
    return bool(column.min() >= 0 and column.max() <= 255)


def _are_normals(block: Sequence[np.ndarray]) -> bool:
    if all(column.dtype.kind == "i" for column in block):
        return False
    with np.errstate(invalid="ignore"):
        length = np.sqrt(sum(np.square(np.asarray(column, np.float64)) for column in block))
        unit = np.abs(length - 1) <= UNIT
        return bool((unit | (length == 0) | np.isnan(length)).all() and unit.any())
