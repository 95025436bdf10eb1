"""Selection of new points among many candidates: those that fill the gaps of a cloud."""

import math
from bisect import bisect_left, bisect_right

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 6
"""Number of neighbours whose mean distance is the spacing at a point."""
MAX_RATIO = 2.0
"""Upper limit of a point's spacing, as a multiple of the median of its neighbours'. Stray points exceed it."""
REACH = 1.2
"""Candidates farther than `REACH` local spacings from the cloud are rejected."""
DUPLICATE = 1e-6
"""Candidates closer than this to a point of the cloud, in radii of the patch, are duplicates."""
SLACK = 1.0001
"""Factor on the width of the slab in which `spread_out` updates distances; it covers rounding errors."""


def spacing(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Compute the local spacing at each point: the mean distance to its neighbours, limited for stray points."""
    k = min(NEIGHBOURS + 1, len(points))
    distances, nearest = cKDTree(points).query(points, k=k)
    own = distances[:, 1:].mean(1)
    around: Float[np.ndarray, " n"] = np.median(own[nearest[:, 1:]], axis=1)
    limited: Float[np.ndarray, " n"] = np.minimum(own, MAX_RATIO * around)
    return limited


def within_reach(
    candidates: Float[np.ndarray, "c 3"], points: Float[np.ndarray, "n 3"]
) -> tuple[Bool[np.ndarray, " c"], Float[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Find the candidates that lie within the cloud's spacing of a point and duplicate none.

    Args:
        candidates: (c 3), in the frame in which the points fill the unit sphere.
        points: the cloud, (n 3).

    Returns:
        Whether a candidate is one of those, its distance to the nearest point, and that point's index; (c) each.
    """
    distance, nearest = cKDTree(points).query(candidates)
    close: Bool[np.ndarray, " c"] = (distance <= REACH * spacing(points)[nearest]) & (distance > DUPLICATE)
    return close, distance, nearest


def spread_out(
    candidates: Float[np.ndarray, "c 3"],
    distance: Float[np.ndarray, " c"] | None,
    core: Bool[np.ndarray, " c"],
    count: int,
) -> Int[np.ndarray, " chosen"]:
    """Choose candidates by farthest point sampling from existing points, until `count` of the core are chosen.

    Candidates of neighbouring patches compete but do not count towards `count`; otherwise points pile up at the borders
    of patches. Of equally far candidates the first along x is chosen.

    No candidate is farther from the chosen points than the one that is chosen next. Choosing it thus changes
    no distance of candidates that differ from it by more than that along x, and only the slab in between is updated.

    Args:
        candidates: (c 3), in any frame; fastest where they extend farthest along x. Differences are computed in single
            precision.
        distance: of each candidate to the nearest existing point, (c). None: there are no points, and the candidate
            farthest from the centre is chosen first.
        core: whether a candidate belongs to the core of its patch, (c).
        count: number of candidates of the core to choose.

    Returns:
        Indices of the chosen candidates of the core: `count` of them, or all if there are fewer.
    """
    count = min(count, int(core.sum()))
    if count == 0:
        return np.zeros(0, np.int64)
    along = np.argsort(candidates[:, 0], kind="stable")
    sorted_ones = candidates[along]
    axes = np.ascontiguousarray((sorted_ones - sorted_ones.mean(0)).T, np.float32)
    x, in_core = axes[0].tolist(), core[along].tolist()
    if distance is None:
        squared = np.full(len(along), np.inf, np.float32)
        last = int(np.square(axes).sum(0).argmax())
    else:
        squared = np.square(distance[along]).astype(np.float32)
        last = int(squared.argmax())
    chosen: list[int] = []
    while True:
        if in_core[last]:
            chosen.append(last)
            if len(chosen) == count:
                return along[chosen]
        reach = SLACK * math.sqrt(squared[last])
        slab = slice(bisect_left(x, x[last] - reach), bisect_right(x, x[last] + reach))
        away = axes[:, slab] - axes[:, last, None]
        away *= away
        np.minimum(squared[slab], away[0] + away[1] + away[2], out=squared[slab])
        squared[last] = -1  # not chosen again, even if all other candidates coincide with chosen ones
        last = int(squared.argmax())


def between(points: Float[np.ndarray, "n 3"], core: int, count: int) -> Float[np.ndarray, "count 3"]:
    """Interpolate `count` points between the first `core` points and their neighbours, where candidates run out.

    They lie within the local spacing of their point, and closer to it than to its neighbour.
    """
    if count == 0:
        return np.zeros((0, 3))
    k = min(NEIGHBOURS + 1, len(points))
    nearest = cKDTree(points).query(points[:core], k=k)[1][:, 1:]
    limit = spacing(points)[:core]
    new: list[Float[np.ndarray, "_ 3"]] = []
    for turn in range(-(-count // core)):
        fraction = _spread_fraction(turn // nearest.shape[1])
        offset = points[nearest[:, turn % nearest.shape[1]]] - points[:core]
        length = np.linalg.norm(offset, axis=1)
        share = np.minimum(fraction, np.divide(REACH * limit, length, out=np.ones(core), where=length > 0))
        new.append(points[:core] + offset * share[:, None])
    return np.concatenate(new)[:count]


def _spread_fraction(turn: int) -> float:
    """Return the fraction of the offset in a turn, a van der Corput sequence below 0.48: neighbours never coincide."""
    value, step, number = 0.0, 0.5, turn + 1
    while number:
        value, step, number = value + step * (number % 2), step / 2, number // 2
    return 0.48 * value
