"""Choosing new points among many candidates: where the gaps are, and nowhere else."""

import math
from bisect import bisect_left, bisect_right

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 6
"""A point's spacing is the mean distance to so many neighbours."""
LONELY = 2.0
"""At most so many times its neighbours' spacing counts: a stray point is not a coarsely sampled surface."""
REACH = 1.2
"""New points lie within so many spacings of the point that they are nearest to."""
SAME = 1e-6
"""And farther from it than this, in radii of the patch: a copy is nothing new."""
SLACK = 1.0001
"""Rounding must not put a candidate outside of the slab in which distances change."""


def spacing(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """How far apart the points of a cloud are about each of them."""
    k = min(NEIGHBOURS + 1, len(points))
    distances, nearest = cKDTree(points).query(points, k=k)
    own = distances[:, 1:].mean(1)
    around: Float[np.ndarray, " n"] = np.median(own[nearest[:, 1:]], axis=1)
    limited: Float[np.ndarray, " n"] = np.minimum(own, LONELY * around)
    return limited


def within_reach(
    candidates: Float[np.ndarray, "c 3"], points: Float[np.ndarray, "n 3"]
) -> tuple[Bool[np.ndarray, " c"], Float[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Which candidates are new and bridge no gap wider than the cloud's spacing.

    Args:
        candidates: in the frame in which the points fill the unit sphere.
        points: the cloud.

    Returns:
        Whether a candidate is one of those; how far it is from the point nearest to it; and that point.
    """
    distance, nearest = cKDTree(points).query(candidates)
    close: Bool[np.ndarray, " c"] = (distance <= REACH * spacing(points)[nearest]) & (distance > SAME)
    return close, distance, nearest


def spread_out(
    candidates: Float[np.ndarray, "c 3"],
    distance: Float[np.ndarray, " c"] | None,
    mine: Bool[np.ndarray, " c"],
    count: int,
) -> Int[np.ndarray, " chosen"]:
    """Farthest point sampling that goes on from points that are there, until `count` of one's own are chosen.

    Candidates that are somebody else's are chosen among the others but not counted: so an edge of what is mine draws
    no more points than the middle. Of equally far ones the first along x is taken.

    No candidate is farther from what is there than the one that is taken. So taking it changes nothing for those that
    are farther from it than that along x alone, and only the slab between is looked at.

    Args:
        candidates: what can be taken, in any frame; fastest where they spread widest along x. Their differences are
            looked at in single precision.
        distance: of each to what is there already. None: nothing is, and the one farthest from the middle comes first.
        mine: which of them are one's own.
        count: how many of those to choose.

    Returns:
        Indices of chosen candidates that are mine: `count`, or all there are.
    """
    count = min(count, int(mine.sum()))
    if count == 0:
        return np.zeros(0, np.int64)
    along = np.argsort(candidates[:, 0], kind="stable")
    sorted_ones = candidates[along]
    axes = np.ascontiguousarray((sorted_ones - sorted_ones.mean(0)).T, np.float32)
    x, own = axes[0].tolist(), mine[along].tolist()
    if distance is None:
        squared = np.full(len(along), np.inf, np.float32)
        last = int(np.square(axes).sum(0).argmax())
    else:
        squared = np.square(distance[along]).astype(np.float32)
        last = int(squared.argmax())
    chosen: list[int] = []
    while True:
        if own[last]:
            chosen.append(last)
            if len(chosen) == count:
                return along[chosen]
        reach = SLACK * math.sqrt(squared[last])
        slab = slice(bisect_left(x, x[last] - reach), bisect_right(x, x[last] + reach))
        away = axes[:, slab] - axes[:, last, None]
        away *= away
        np.minimum(squared[slab], away[0] + away[1] + away[2], out=squared[slab])
        squared[last] = -1  # never twice, even where all that is left coincides with taken ones
        last = int(squared.argmax())


def between(points: Float[np.ndarray, "n 3"], core: int, count: int) -> Float[np.ndarray, "count 3"]:
    """`count` points on the edges from the first `core` points to their neighbours: for where candidates run out.

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
    """Below a half, so that two neighbours on their edges to each other don't meet; far from those before."""
    value, step, number = 0.0, 0.5, turn + 1
    while number:
        value, step, number = value + step * (number % 2), step / 2, number // 2
    return 0.48 * value
