"""One cloud: its points, what is known of each of them, and what its file was like."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int

from pcsr.clouds.carry import carry
from pcsr.errors import UserError


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
        if any(about.get("coordinates") in ("float", "f4") for about in self.about.values() if isinstance(about, dict)):
            with np.errstate(over="ignore"):
                single = points.astype(np.float32).astype(np.float64)
            # As exact as the old ones, and the file stays single; text may have called doubles so.
            points = single if np.isfinite(single).all() else points
        columns = carry(self.columns, self.points, points)
        if keep:
            points = np.concatenate([self.points, points])
            columns = {name: np.concatenate([self.columns[name], column]) for name, column in columns.items()}
        return Cloud(points, columns, self.about)
