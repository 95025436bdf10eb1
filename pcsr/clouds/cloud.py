"""One cloud: its points, what is known of each of them, and what its file was like."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int

from pcsr.errors import UserError

COLOURS = ("red", "green", "blue", "alpha")
SHORT_COLOURS = ("r", "g", "b")
COLOUR_BLOCKS = ("color", "colors", "colour", "colours", "rgb", "rgba")
"""Names of columns that hold three or four colours at once."""
NORMALS = ("nx", "ny", "nz")
NORMAL_BLOCKS = ("normal", "normals")
"""Names of columns that hold whole normals."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points with any number of columns beside them."""

    points: Float64[np.ndarray, "n 3"]
    """In the file's own frame and unit."""
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    """What is known of each point: name to (n,) or (n, k) of numbers or truth values, in the file's order."""
    about: dict[str, Any] = field(default_factory=dict)
    """What a format needs to write the same kind of file again, under the format's name.

    `dropped` is the number of rows that were left out on reading, `left out` names what could not be kept.
    """

    def __post_init__(self) -> None:
        if self.points.dtype != np.float64 or self.points.ndim != 2 or self.points.shape[1] != 3:
            raise UserError(f"points are doubles of shape (n, 3), not {self.points.dtype} {self.points.shape}")
        for name, column in self.columns.items():
            if name in ("x", "y", "z"):
                raise UserError(f"no column of a cloud is called '{name}': that is a coordinate")
            if column.ndim not in (1, 2) or len(column) != len(self.points) or column.dtype.kind not in "biuf":
                raise UserError(
                    f"column '{name}' holds {column.dtype} {column.shape}: it needs {len(self.points)} rows of numbers"
                )

    def __len__(self) -> int:
        return len(self.points)

    def chosen(self, rows: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"]) -> "Cloud":
        """The rows with these indices, in their order, or those where a mask is True."""
        return Cloud(self.points[rows], {name: column[rows] for name, column in self.columns.items()}, self.about)

    def with_new(self, points: Float64[np.ndarray, "new 3"], *, keep: bool = True) -> "Cloud":
        """A cloud of new points, their columns carried over; the old points come before them unless not kept."""
        from pcsr.clouds.carry import carry

        columns = carry(self.columns, self.points, points)
        if keep:
            points = np.concatenate([self.points, points])
            columns = {name: np.concatenate([self.columns[name], column]) for name, column in columns.items()}
        return Cloud(points, columns, self.about)


def colour_names(columns: Mapping[str, np.ndarray]) -> list[str]:
    """The columns that hold colours: red, green and blue where all three are there, with alpha; r, g, b; blocks."""
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
    """The groups of columns that hold normals: three of one number each, or one of three."""
    by_name = {name.lower(): name for name, column in columns.items() if column.ndim == 1}
    groups = [[by_name[name] for name in NORMALS]] if by_name.keys() >= set(NORMALS) else []
    return groups + [[name] for name, column in columns.items() if is_block(name, column, NORMAL_BLOCKS)]


def is_block(name: str, column: np.ndarray, names: Iterable[str]) -> bool:
    """Whether a column holds whole colours or normals, going by its name and width."""
    widths = (3,) if name.lower() in NORMAL_BLOCKS else (3, 4)
    return name.lower() in names and column.ndim == 2 and column.shape[1] in widths


def spread(columns: Mapping[str, np.ndarray], rest: bool) -> dict[str, np.ndarray]:
    """Blocks of colours and normals as the columns red, green, blue and nx, ny, nz, as most formats have them.

    Args:
        columns: of a cloud.
        rest: whether other columns of k numbers become k columns, too: label (n, 2) becomes label_0 and label_1.
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
    """`name`, or the first of name_2, name_3 ... that is not taken."""
    taken, number, free = set(taken), 2, name
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free


def one_word_names(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns with names that hold no white space, commas or quotes: each becomes an underscore."""
    clean: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        word = "".join("_" if c.isspace() or not c.isprintable() or c in ",\"'" else c for c in name) or "_"
        clean[unused(word, [*clean, "x", "y", "z"])] = column
    return clean


def native(column: np.ndarray) -> np.ndarray:
    """The column in the machine's byte order, in memory of its own."""
    return np.array(column, column.dtype.newbyteorder("="), order="C")
