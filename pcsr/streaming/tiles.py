"""Tiles of a cloud: the leaves of a tree of planes, each with about the same number of points."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int

MIDDLE = (0.1, 0.9)
"""Quantiles between which the extent of points along an axis is measured, so that a few far ones do not count."""


@dataclass(frozen=True, eq=False)
class TileTree:
    """Complete binary tree of planes that divides space into 2^depth tiles. Consecutive tiles are neighbours."""

    axes: Int[np.ndarray, " nodes"]
    """Axis that the plane of each node is perpendicular to; the children of node i are 2i + 1 and 2i + 2."""
    at: Float64[np.ndarray, " nodes"]
    """Coordinate of the plane. Points with this coordinate lie in the second child."""

    @classmethod
    def of(cls, sample: Float64[np.ndarray, "n 3"], depth: int) -> "TileTree":
        """Divide a sample of a cloud by medians.

        Args:
            sample: finite points, at least one.
            depth: number of planes between the root and a tile.
        """
        nodes = 2**depth - 1
        axes, at = np.zeros(nodes, np.int64), np.zeros(nodes)
        parts = [sample]
        for node in range(nodes):
            points = parts[node]
            if len(points):
                low, high = np.quantile(points, MIDDLE, axis=0, method="nearest")
                axes[node] = int(np.argmax(high - low))
                at[node] = float(np.median(points[:, axes[node]]))
            right = points[:, axes[node]] >= at[node]
            parts += [points[~right], points[right]]
        return cls(axes, at)

    def tiles(self, points: Float64[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Return the number of the tile that each point lies in."""
        node = np.zeros(len(points), np.int64)
        rows = np.arange(len(points))
        for _ in range(int(np.log2(len(self.axes) + 1))):
            node = 2 * node + 1 + (points[rows, self.axes[node]] >= self.at[node])
        tiles: Int[np.ndarray, " n"] = node - len(self.axes)
        return tiles


def depth_for(count: int, most: int) -> int:
    """Return the depth of a tree whose tiles have about half of `most` to `most` points of `count`."""
    return max(0, int(np.ceil(np.log2(count / most))))


def box_distance(
    points: Float64[np.ndarray, "n 3"], lower: Float64[np.ndarray, "3"], upper: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, " n"]:
    """Return the distance of each point from a box; 0 inside of it."""
    outside = np.maximum(np.maximum(lower - points, points - upper), 0.0)
    distance: Float64[np.ndarray, " n"] = np.linalg.norm(outside, axis=1)
    return distance


def boxes_apart(
    lower: Float64[np.ndarray, "3"],
    upper: Float64[np.ndarray, "3"],
    lowers: Float64[np.ndarray, "b 3"],
    uppers: Float64[np.ndarray, "b 3"],
) -> Float64[np.ndarray, " b"]:
    """Return the distance of each of several boxes from one box; 0 where they overlap."""
    gap = np.maximum(np.maximum(lowers - upper, lower - uppers), 0.0)
    distance: Float64[np.ndarray, " b"] = np.linalg.norm(gap, axis=1)
    return distance
