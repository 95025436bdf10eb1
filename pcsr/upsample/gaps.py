"""Spacing of clouds, and points for their gaps: candidates near a cloud, and interpolated points where they run out."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

NEIGHBOURS = 6
"""Number of neighbours whose mean distance is the spacing at a point."""
MAX_RATIO = 2.0
"""Upper limit of a point's spacing, as a multiple of the median of its neighbours'."""
AROUND = 32
"""Number of nearest points, itself included, whose spacings tell whether a point is a stray point."""
DEVIATIONS = 6.0
"""A point is a stray point if the ratio of its spacing to the median around it exceeds 1 by so many median absolute
deviations of this ratio: even clouds have few points with another spacing than those around, random ones many."""
LEAST_RATIO, MOST_RATIO = 1.5, 2.0
"""Limits of that ratio: up to the first no point is a stray point, beyond the second every point is."""
REACH = 1.2
"""Candidates farther than `REACH` local spacings from the cloud are rejected."""
DUPLICATE = 1e-6
"""Candidates closer than this to a point of the cloud, in radii of the patch, are duplicates."""


def spacing(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Compute the local spacing at each point: the mean distance to its neighbours, limited for stray points."""
    own, around = _spacings(points, NEIGHBOURS + 1)
    limited: Float[np.ndarray, " n"] = np.minimum(own, MAX_RATIO * around)
    return limited


def strays(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Find the points that are far from their neighbours, compared with the distances among those around."""
    own, around = _spacings(points, AROUND)
    ratio = np.divide(own, around, out=np.ones(len(points)), where=around > 0)
    deviation = float(np.median(np.abs(ratio - np.median(ratio))))
    far: Bool[np.ndarray, " n"] = ratio > np.clip(1 + DEVIATIONS * deviation, LEAST_RATIO, MOST_RATIO)
    return far


def _spacings(points: Float[np.ndarray, "n 3"], count: int) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the spacing of each point, and the median of those of its nearest points."""
    k = min(max(NEIGHBOURS + 1, count), len(points))
    distances, nearest = cKDTree(points).query(points, k=k)
    own = distances[:, 1 : NEIGHBOURS + 1].mean(1)
    return own, np.median(own[nearest[:, :count]], axis=1)


def within_reach(
    candidates: Float[np.ndarray, "c 3"], points: Float[np.ndarray, "n 3"], unit: Float[np.ndarray, " n"]
) -> tuple[Bool[np.ndarray, " c"], Float[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Find the candidates that lie within the cloud's spacing of a point and duplicate none.

    Args:
        candidates: (c 3), in the frame in which the points fill the unit sphere.
        points: the cloud, (n 3).
        unit: the local spacing at each point, (n).

    Returns:
        Whether a candidate is one of those, its distance to the nearest point, and that point's index; (c) each.
    """
    distance, nearest = cKDTree(points).query(candidates)
    close: Bool[np.ndarray, " c"] = (distance <= REACH * unit[nearest]) & (distance > DUPLICATE)
    return close, distance, nearest


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
