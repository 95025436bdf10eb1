"""Spacing of clouds, and points for their gaps: candidates near a cloud, and interpolated points where they run out."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from pcsr.tensors import CloudArray
from pcsr.upsample.neighbours import SPACED, Cloud, Neighbours

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


def spacing(cloud: Cloud) -> Float[np.ndarray, " n"]:
    """Compute the local spacing at each point: the mean distance to its neighbours, limited for stray points."""
    neighbours = Neighbours.of(cloud, SPACED + 1)
    limited: Float[np.ndarray, " n"] = np.minimum(
        neighbours.mean_distance, MAX_RATIO * neighbours.median_around(SPACED + 1)
    )
    return limited


def strays(cloud: Cloud) -> Bool[np.ndarray, " n"]:
    """Find the points that are far from their neighbours, compared with the distances among those around."""
    neighbours = Neighbours.of(cloud, AROUND)
    own, around = neighbours.mean_distance, neighbours.median_around(AROUND)
    ratio = np.divide(own, around, out=np.ones(len(own)), where=around > 0)
    deviation = float(np.median(np.abs(ratio - np.median(ratio))))
    far: Bool[np.ndarray, " n"] = ratio > np.clip(1 + DEVIATIONS * deviation, LEAST_RATIO, MOST_RATIO)
    return far


def within_reach(
    candidates: Float[np.ndarray, "c 3"], cloud: Cloud, unit: Float[np.ndarray, " n"]
) -> tuple[Bool[np.ndarray, " c"], Float[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Find the candidates that lie within the cloud's spacing of a point and duplicate none.

    Args:
        candidates: (c 3), in the frame in which the points fill the unit sphere.
        cloud: the points, (n 3).
        unit: the local spacing at each point, (n).

    Returns:
        Whether a candidate is one of those, its distance to the nearest point, and that point's index; (c) each.
    """
    distance, nearest = Neighbours.of(cloud, 1).tree.query(candidates)
    close: Bool[np.ndarray, " c"] = (distance <= REACH * unit[nearest]) & (distance > DUPLICATE)
    return close, distance, nearest


def touched_ones(candidates: Float[np.ndarray, "c 3"], touches: Sequence[CloudArray]) -> Bool[np.ndarray, " c"]:
    """Return which candidates are touched points: measured ones, up to the single precision of networks.

    Args:
        candidates: (c 3), in the frame in which the points fill the unit sphere.
        touches: touched points in the same frame, (m 3) for each touch.
    """
    if not touches or len(candidates) == 0:
        return np.zeros(len(candidates), bool)
    tree = cKDTree(np.concatenate(touches))
    same: Bool[np.ndarray, " c"] = np.isfinite(tree.query(candidates, distance_upper_bound=DUPLICATE)[0])
    return same


def between(cloud: Cloud, core: int, count: int) -> Float[np.ndarray, "count 3"]:
    """Interpolate `count` points between the first `core` points and their neighbours, where candidates run out.

    They lie within the local spacing of their point, and closer to it than to its neighbour.
    """
    if count == 0:
        return np.zeros((0, 3))
    neighbours = Neighbours.of(cloud, SPACED + 1)
    points, nearest = neighbours.points, neighbours.index[:core, 1 : SPACED + 1]
    limit = spacing(neighbours)[:core]
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
