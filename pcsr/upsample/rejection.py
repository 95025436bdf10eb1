"""Rejection of candidates that are likely off the surface, or too many around stray points."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

AGREEING = 20
"""The distance to the candidate of this rank tells how many others agree with a candidate."""
PLANES = 8
"""Number of nearest points whose tangent planes a candidate is compared with."""
HEIGHT = 0.2
"""Largest distance of a candidate to the closest of these planes, in spacings."""


def isolation(
    candidates: Float[np.ndarray, "c 3"], some: Int[np.ndarray, " s"], unit: Float[np.ndarray, " s"]
) -> Float[np.ndarray, " s"]:
    """Compute the distance of some candidates to the one of rank `AGREEING`, in local spacings.

    Candidates that several points of the cloud generate at about the same place lie on the surface more likely.

    Args:
        candidates: (c 3), in any frame.
        some: indices of the candidates that it is computed for, (s).
        unit: the spacing of the cloud near each of them, (s).
    """
    distance = cKDTree(candidates, balanced_tree=False).query(candidates[some], k=[min(AGREEING + 1, len(candidates))])[
        0
    ][:, 0]
    isolated: Float[np.ndarray, " s"] = np.divide(distance, unit, out=np.full(len(unit), np.inf), where=unit > 0)
    return isolated


def few_each(nearest: Int[np.ndarray, " c"], most: int, isolated: Float[np.ndarray, " c"]) -> Bool[np.ndarray, " c"]:
    """Return which candidates remain if each point may have no more than `most`, the least isolated.

    Args:
        nearest: index of the point nearest to each candidate, (c).
        most: largest number of candidates of a point.
        isolated: `isolation` of each candidate, (c).
    """
    order = np.lexsort((isolated, nearest))
    first = np.searchsorted(nearest[order], nearest[order])
    rank = np.zeros(len(nearest), np.int64)
    rank[order] = np.arange(len(nearest)) - first
    kept: Bool[np.ndarray, " c"] = rank < most
    return kept


def on_planes(
    candidates: Float[np.ndarray, "c 3"],
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    unit: Float[np.ndarray, " n"],
) -> Bool[np.ndarray, " c"]:
    """Return which candidates are near the tangent plane of a nearest point, as none between two sheets is.

    Args:
        candidates: (c 3), in the frame of the points.
        points: the points with normals, (n 3).
        normals: unit normals of either sign, (n 3).
        unit: the local spacing at each point, (n).
    """
    index = cKDTree(points).query(candidates, k=range(1, min(PLANES, len(points)) + 1))[1]
    heights = np.abs(((candidates[:, None] - points[index]) * normals[index]).sum(-1)).min(1)
    near: Bool[np.ndarray, " c"] = heights <= HEIGHT * unit[index[:, 0]]
    return near
