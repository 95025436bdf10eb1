"""Choosing new points among many candidates: where the gaps are, and nowhere else."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.sampling import Gaps

NEIGHBOURS = 6
"""A point's spacing is the mean distance to so many neighbours."""
LONELY = 2.0
"""At most so many times its neighbours' spacing counts: a stray point is not a coarsely sampled surface."""
REACH = 1.2
"""New points lie within so many spacings of the point that they are nearest to."""
SAME = 1e-6
"""And farther from it than this, in radii of the patch: a copy is nothing new."""


def spacing(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """How far apart the points of a cloud are about each of them."""
    k = min(NEIGHBOURS + 1, len(points))
    distances, nearest = cKDTree(points).query(points, k=k)
    own = distances[:, 1:].mean(1)
    around: Float[np.ndarray, " n"] = np.median(own[nearest[:, 1:]], axis=1)
    limited: Float[np.ndarray, " n"] = np.minimum(own, LONELY * around)
    return limited


def near(
    candidates: Float[np.ndarray, "c 3"], points: Float[np.ndarray, "n 3"]
) -> tuple[Bool[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Which candidates are new and bridge no gap wider than the cloud's spacing; and each one's nearest point.

    Args:
        candidates: in the frame in which the points fill the unit sphere.
        points: the cloud.
    """
    distance, nearest = cKDTree(points).query(candidates)
    close: Bool[np.ndarray, " c"] = (distance <= REACH * spacing(points)[nearest]) & (distance > SAME)
    return close, nearest


def spread_out(
    candidates: Float[np.ndarray, "c 3"],
    known: Float[np.ndarray, "k 3"],
    mine: Bool[np.ndarray, " c"],
    count: int,
) -> Int[np.ndarray, " chosen"]:
    """Farthest point sampling that goes on from known points, until `count` of one's own are chosen.

    Candidates that are somebody else's are chosen among the others but not counted: so an edge of what is mine draws
    no more points than the middle. Of equally far ones the first is taken.

    Returns:
        Indices of chosen candidates that are mine: `count`, or all there are.
    """
    count = min(count, int(mine.sum()))
    chosen: list[int] = []
    if count == 0:
        return np.array(chosen, np.int64)
    if len(known):
        squared = cKDTree(known).query(candidates)[0] ** 2
        gaps = Gaps(candidates, squared.astype(np.float32))
        last = int(gaps.squared.argmax())
    else:
        gaps = Gaps(candidates, np.full(len(candidates), np.inf, np.float32))
        last = gaps.farthest_from_middle
    while True:
        if mine[last]:
            chosen.append(last)
            if len(chosen) == count:
                return np.array(chosen, np.int64)
        last = gaps.take(last)


def between(points: Float[np.ndarray, "n 3"], core: int, count: int) -> Float[np.ndarray, "count 3"]:
    """`count` points on the ways from the first `core` points to their neighbours: for where candidates run out.

    Never farther from a point than its spacing, nor half the way to its neighbour.
    """
    if count == 0:
        return np.zeros((0, 3))
    k = min(NEIGHBOURS + 1, len(points))
    nearest = cKDTree(points).query(points[:core], k=k)[1][:, 1:]
    limit = spacing(points)[:core]
    made: list[Float[np.ndarray, "_ 3"]] = []
    for turn in range(-(-count // core)):
        fraction = _spread_fraction(turn // nearest.shape[1])
        way = points[nearest[:, turn % nearest.shape[1]]] - points[:core]
        length = np.linalg.norm(way, axis=1)
        share = np.minimum(fraction, np.divide(REACH * limit, length, out=np.ones(core), where=length > 0))
        made.append(points[:core] + way * share[:, None])
    return np.concatenate(made)[:count]


def _spread_fraction(turn: int) -> float:
    """Below a half, so that two neighbours on their ways to each other don't meet; far from those before."""
    value, step, number = 0.0, 0.5, turn + 1
    while number:
        value, step, number = value + step * (number % 2), step / 2, number // 2
    return 0.48 * value
