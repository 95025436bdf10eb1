"""Columns of a cloud beside its coordinates: recognising colours and normals by name, and renaming for file formats."""

from collections.abc import Iterable, Mapping

import numpy as np

COLOURS = ("red", "green", "blue", "alpha")
"""Names of columns that hold one channel of the colours."""
SHORT_COLOURS = ("r", "g", "b")
"""Other names of such columns."""
COLOUR_BLOCKS = ("color", "colors", "colour", "colours", "rgb", "rgba")
"""Names of columns (n, 3) or (n, 4) that hold whole colours."""
NORMALS = ("nx", "ny", "nz")
"""Names of columns that hold one component of the normals."""
NORMAL_BLOCKS = ("normal", "normals")
"""Names of columns (n, 3) that hold whole normals."""


def colour_names(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Return the names of the columns that hold colours.

    These are red, green, blue and alpha if the first three exist; r, g and b if all exist; and whole colours.
    """
    single = {name.lower() for name, column in columns.items() if column.ndim == 1}
    known = {
        *(COLOURS if single.issuperset(COLOURS[:3]) else ()),
        *(SHORT_COLOURS if single.issuperset(SHORT_COLOURS) else ()),
    }
    return [
        name
        for name, column in columns.items()
        if (name.lower() in known if column.ndim == 1 else is_block(name, column, COLOUR_BLOCKS))
    ]


def normal_groups(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    """Return the names of the columns that hold normals, in groups: nx, ny and nz, or one column of whole normals."""
    by_name = {name.lower(): name for name, column in columns.items() if column.ndim == 1}
    groups = [[by_name[name] for name in NORMALS]] if by_name.keys() >= set(NORMALS) else []
    return groups + [[name] for name, column in columns.items() if is_block(name, column, NORMAL_BLOCKS)]


def is_block(name: str, column: np.ndarray, names: Iterable[str]) -> bool:
    """Return whether a column holds whole colours or normals, by its name and width."""
    widths = (3,) if name.lower() in NORMAL_BLOCKS else (3, 4)
    return name.lower() in names and column.ndim == 2 and column.shape[1] in widths


def spread(columns: Mapping[str, np.ndarray], rest: bool) -> dict[str, np.ndarray]:
    """Split columns of whole colours and normals into red, green, blue and nx, ny, nz, as in most file formats.

    Args:
        columns: columns of a cloud.
        rest: whether to split other columns too: label (n, 2) becomes label_0 and label_1.
    """
    flat: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if column.ndim == 1:
            names: Iterable[str] = (name,)
            parts = [column]
        else:
            parts = list(column.T)
            names = [f"{name}_{i}" for i in range(len(parts))]
            for standard, blocks in ((COLOURS, COLOUR_BLOCKS), (NORMALS, NORMAL_BLOCKS)):
                if is_block(name, column, blocks) and not set(standard) & columns.keys():
                    names = standard[: len(parts)]
                    break
            else:
                if not rest:
                    names, parts = (name,), [column]
        for each, part in zip(names, parts, strict=True):
            flat[unused(each, flat)] = np.ascontiguousarray(part)
    return flat


def unused(name: str, taken: Iterable[str]) -> str:
    """Return `name`, or if it is taken the first of name_2, name_3 and so on that is not."""
    taken, number, free = set(taken), 2, name
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free


def one_word_names(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rename columns: white space, commas, quotes and unprintable characters become underscores."""
    clean: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        word = "".join("_" if c.isspace() or not c.isprintable() or c in ",\"'" else c for c in name) or "_"
        clean[unused(word, [*clean, "x", "y", "z"])] = column
    return clean


def native(column: np.ndarray) -> np.ndarray:
    """Copy a column, in the machine's byte order."""
    return np.array(column, column.dtype.newbyteorder("="), order="C")
