"""Distances to known points."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree


def mean_distances(
    points: Float[np.ndarray, "p 3"], known: Float[np.ndarray, "k 3"], neighbours: int
) -> Float[np.ndarray, " p"]:
    """Return the mean distance of each point to its nearest few known points; 0 if nothing is known.

    Args:
        points: points, (p 3).
        known: known points, (k 3), in the same frame and unit.
        neighbours: number of known points over which the mean is taken; all if there are fewer.

    Examples:
        >>> mean_distances(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]), 2)
        array([2.])
    """
    if len(known) == 0 or len(points) == 0:
        return np.zeros(len(points))
    distances, _ = KDTree(known).query(points, k=list(range(1, min(neighbours, len(known)) + 1)))
    means: Float[np.ndarray, " p"] = distances.mean(1)
    return means
