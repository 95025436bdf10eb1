"""Distinct positions of a cloud, each with the number of its points."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int


@dataclass(frozen=True, eq=False)
class Positions:
    """Distinct positions of a cloud, in lexicographic order."""

    points: Float64[np.ndarray, "p 3"]
    """Coordinates of each position."""
    count: Int[np.ndarray, " p"]
    """Number of points at each position."""
    first: Int[np.ndarray, " p"]
    """Row of the first point at each position."""
    index: Int[np.ndarray, " n"]
    """Position of each point of the cloud."""

    @classmethod
    def of(cls, points: Float64[np.ndarray, "n 3"]) -> "Positions":
        """Find the positions of finite points, of which there is at least one."""
        order = np.lexsort(points.T)  # stable: of equal points the first row comes first
        ordered = points[order]
        start = np.flatnonzero(np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)])
        count = np.diff(np.r_[start, len(points)])
        index = np.zeros(len(points), np.int64)
        index[order] = np.repeat(np.arange(len(start)), count)
        return cls(ordered[start], count, order[start], index)

    def rows(self, chosen: Bool[np.ndarray, " p"]) -> Int[np.ndarray, " m"]:
        """Return the rows of the points at the chosen positions, in ascending order."""
        return np.flatnonzero(chosen[self.index])
