"""Nearest points of each point of a cloud, searched once for all that is derived from them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.tensors import CloudArray

MOST = 32
"""Number of nearest points that is searched by default, itself included: the most that any part of a patch needs."""
SPACED = 6
"""Number of neighbours whose mean distance is the spacing at a point."""


@dataclass(frozen=True)
class Neighbours:
    """A cloud, its k-d tree, and the nearest points of each point."""

    points: CloudArray
    """The cloud, (n 3), in any frame."""
    tree: cKDTree
    distances: Float[np.ndarray, "n k"]
    """Distances to the nearest points, the nearest first. The first is the point itself, or a copy of it."""
    index: Int[np.ndarray, "n k"]
    """Indices of the nearest points."""

    @classmethod
    def of(cls, cloud: "Cloud", count: int = MOST) -> "Neighbours":
        """Search the neighbours of a cloud, unless that was done.

        Args:
            cloud: (n 3), in any frame; or its neighbours, which are returned unchanged.
            count: number of nearest points, itself included; all if there are fewer.
        """
        if isinstance(cloud, Neighbours):
            return cloud
        tree = cKDTree(cloud)
        distances, index = tree.query(cloud, k=range(1, min(count, len(cloud)) + 1))
        return cls(cloud, tree, distances, index)

    @cached_property
    def mean_distance(self) -> Float[np.ndarray, " n"]:
        """Mean distance to the `SPACED` nearest other points."""
        mean: Float[np.ndarray, " n"] = self.distances[:, 1 : SPACED + 1].mean(1)
        return mean

    def median_around(self, count: int) -> Float[np.ndarray, " n"]:
        """Compute the median of the mean distances of the `count` nearest points, itself included."""
        median: Float[np.ndarray, " n"] = np.median(self.mean_distance[self.index[:, :count]], axis=1)
        return median


Cloud = CloudArray | Neighbours
"""A cloud, or its neighbours where they were searched before."""
