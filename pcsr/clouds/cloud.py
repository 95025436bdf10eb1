"""Point cloud with columns such as colours, and with the properties of its file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int

from pcsr.clouds.carry import carry
from pcsr.clouds.column_kinds import ColumnKinds
from pcsr.clouds.columns import normal_groups, unused
from pcsr.errors import UserError

SCANNED, MADE, TOUCHED = 0, 1, 2
"""Values of the column `source`: points of the input, points made by upsampling, touched points of unseen regions."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points of a cloud, with any number of further columns."""

    points: Float64[np.ndarray, "n 3"]
    """Coordinates, in the frame and unit of the file."""
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    """Columns by name, in the order of the file: numbers or booleans of shape (n,) or (n, k)."""
    about: dict[str, Any] = field(default_factory=dict)
    """Properties that a format needs to write the same kind of file again, by the format's name.

    `dropped` is the number of rows that were dropped on reading. `left out` names the data that could not be kept.
    `notes` are sentences on what a reader left out or guessed; `read_cloud` warns of each.
    """

    def __post_init__(self) -> None:
        if self.points.dtype != np.float64 or self.points.ndim != 2 or self.points.shape[1] != 3:
            raise UserError(f"points must be doubles of shape (n, 3), got {self.points.dtype} {self.points.shape}")
        for name, column in self.columns.items():
            if name in ("x", "y", "z"):
                raise UserError(f"a column of a cloud is called '{name}', the name of a coordinate: rename it")
            if column.ndim not in (1, 2) or len(column) != len(self.points) or column.dtype.kind not in "biuf":
                raise UserError(
                    f"column '{name}' holds {column.dtype} {column.shape}: it needs {len(self.points)} rows of numbers"
                )

    def __len__(self) -> int:
        return len(self.points)

    @property
    def is_single(self) -> bool:
        """Whether the file had coordinates in single precision."""
        return any(
            about.get("coordinates") in ("float", "f4") for about in self.about.values() if isinstance(about, dict)
        )

    def chosen(self, rows: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"]) -> "Cloud":
        """Return the cloud of the rows with these indices, in their order, or of those where a mask is True."""
        return Cloud(self.points[rows], {name: column[rows] for name, column in self.columns.items()}, self.about)

    @property
    def normals(self) -> Float64[np.ndarray, "n 3"] | None:
        """The unit normals, by the names of the columns; 0 where there is none. None for a cloud without normals."""
        groups = normal_groups(self.columns)
        if not groups:
            return None
        normals = np.column_stack([self.columns[name] for name in groups[0]]).astype(np.float64)
        normals[~np.isfinite(normals).all(1)] = 0
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit: Float64[np.ndarray, "n 3"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
        return unit

    def with_new(
        self,
        points: Float64[np.ndarray, "new 3"],
        *,
        keep: bool = True,
        used: Bool[np.ndarray, " n"] | None = None,
        kinds: ColumnKinds | None = None,
    ) -> "Cloud":
        """Return a cloud with new points, whose columns are interpolated from the old points.

        Args:
            points: new points.
            keep: put the old points before the new ones; otherwise they are dropped.
            used: which old points columns are interpolated from; all by default.
            kinds: how each column is interpolated; by default as `column_kinds` finds.
        """
        if self.is_single:
            with np.errstate(over="ignore", under="ignore"):
                single = points.astype(np.float32).astype(np.float64)
            # Single precision, as in the file, unless a text file declares doubles as single.
            points = single if np.allclose(single, points, rtol=1e-6, atol=1e-30) else points
        old = self if used is None or used.all() else self.chosen(used)
        columns = carry(old.columns, old.points, points, kinds=kinds)
        if keep:
            points = np.concatenate([self.points, points])
            columns = {name: np.concatenate([self.columns[name], column]) for name, column in columns.items()}
        return Cloud(points, columns, self.about)

    def with_fields(
        self, fields: Sequence[str], new_sources: Int[np.ndarray, " m"], errors: Float64[np.ndarray, " n"] | None = None
    ) -> "Cloud":
        """Return the cloud with further columns, in their order; `source` is `source_2` if there is such a column.

        Args:
            fields: `source` and `error`, or one of them.
            new_sources: source of each of the last m points, `MADE` or `TOUCHED`; the others are `SCANNED`.
            errors: expected error of each point, in the unit of the cloud; NaN where it is unknown. The column has the
                precision of the coordinates.
        """
        columns = dict(self.columns)
        for name in fields:
            if name == "source":
                column = np.full(len(self), SCANNED, np.uint8)
                column[len(self) - len(new_sources) :] = new_sources
            else:
                known = np.full(len(self), np.nan) if errors is None else errors
                column = known.astype(np.float32) if self.is_single else known
            columns[unused(name, columns)] = column
        return Cloud(self.points, columns, self.about)
