"""Columns of a cloud beside its coordinates: recognising colours and normals by name, and renaming for file formats."""

import re
from collections.abc import Iterable, Iterator, Mapping

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
NORMAL_STEMS = ("n", "norm", "normal", "normals")
"""Names of normals without the component: nx, normal_x, Normals.X, scalar_Nx."""
COMPONENT = re.compile(r"(?:scalar_)?(.+?)[\s_.\-\[(]*([wxyz]|[0-4])[\])]?", re.IGNORECASE)
"""Name of one component of a vector: a stem, such as normal, and a letter or number."""
COMPONENTS = {3: ("xyz", "012", "123"), 4: ("wxyz", "0123", "1234")}
"""Letters or numbers of the components of a vector, by its length."""


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
    """Return the names of the columns that hold normals, in groups: three components, or one column of whole normals.

    The components are nx, ny and nz, or normal_x, normal_y and normal_z, in any spelling of `vectors`.
    """
    groups = [
        names for stem, axes, names in vectors(columns, 3) if stem in NORMAL_STEMS and (axes == "xyz" or len(stem) > 1)
    ]
    return groups + [[name] for name, column in columns.items() if is_block(name, column, NORMAL_BLOCKS)]


def vectors(columns: Mapping[str, np.ndarray], size: int) -> Iterator[tuple[str, str, list[str]]]:
    """Find the columns whose names differ only in the component of a vector: dir_x, dir_y, dir_z, or rot_0 to rot_3.

    Case, separators (dirX, dir.x, dir[0]) and CloudCompare's prefix scalar_ make no difference.

    Args:
        columns: columns of a cloud.
        size: number of components, 3 or 4.

    Yields:
        The stem in lower case (dir), the components (xyz), and the names in the order of the components.
    """
    by_stem: dict[str, dict[str, str]] = {}
    for name, column in columns.items():
        if column.ndim == 1 and (match := COMPONENT.fullmatch(name)):
            by_stem.setdefault(match[1].lower(), {}).setdefault(match[2].lower(), name)
    for stem, parts in by_stem.items():
        for axes in COMPONENTS[size]:
            if parts.keys() >= set(axes):
                yield stem, axes, [parts[axis] for axis in axes]


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
