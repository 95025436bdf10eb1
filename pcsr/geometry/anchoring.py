"""Evenly spaced subsets of a dense cloud that keep its touched points."""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.farthest import farthest_points

SUBSAMPLE = 16
"""The spacing is estimated on every 16th point."""
MIN_SUBSAMPLE = 64
"""The spacing is estimated on at least 64 points. In smaller samples most points lie on the border and bias it."""
TOUCHED_SPACING = 0.9
"""Kept touched points are at least `TOUCHED_SPACING` × spacing apart, so that the cloud is no denser where it was
touched."""
CLEARANCE = 1.0
"""Generated points closer than `CLEARANCE` × spacing to a touched point are dropped in favour of it."""


def even_subset(points: Float[np.ndarray, "n 3"], count: int, touched: int = 0) -> Int[np.ndarray, " count"]:
    """Choose `count` evenly spaced points by farthest point sampling, touched points in favour of generated ones.

    Generated points close to a touched one are dropped (`CLEARANCE`), as are touched points close to each other
    (`TOUCHED_SPACING`). The subset is chosen from the rest. If too few points are left, the generated points farthest
    from all touched ones are used again.

    Args:
        points: the dense cloud in any frame, touched points first.
        count: number of points to choose.
        touched: number of touched points.

    Returns:
        Indices of the chosen points.

    Raises:
        UserError: there are fewer than `count` points.
    """
    if not touched or not np.isfinite(points).all():  # metrics report a network that has diverged
        return farthest_points(points, count)
    generated = len(points) - touched
    gap = subset_spacing(points[touched:] if generated > 1 else points, count)
    kept_touched = farthest_points(points[:touched], touched)
    spread = spread_prefix(points[kept_touched], TOUCHED_SPACING * gap)
    kept_touched = kept_touched[: max(spread, count - generated)]
    tree = cKDTree(points[:touched])
    clear = np.flatnonzero(np.isinf(tree.query(points[touched:], distance_upper_bound=CLEARANCE * gap)[0]))
    if len(kept_touched) + len(clear) < count:
        clear = tree.query(points[touched:])[0].argsort(kind="stable")[len(kept_touched) - count :]
    left = np.concatenate([kept_touched, touched + clear])
    kept: Int[np.ndarray, " count"] = left[farthest_points(points[left], count)]
    return kept


def spread_prefix(ordered: Float[np.ndarray, "n 3"], gap: float) -> int:
    """Return how many of the first points are at least `gap` apart from each other.

    Args:
        ordered: points in the order of farthest point sampling.
        gap: distance in the unit of the points.
    """
    low, high = 1, len(ordered)
    while low < high:
        middle = (low + high + 1) // 2
        nearest = cKDTree(ordered[:middle]).query(ordered[:middle], k=[2])[0].min()
        low, high = (middle, high) if nearest >= gap else (low, middle - 1)
    return low


def subset_spacing(points: Float[np.ndarray, "n 3"], count: int) -> float:
    """Estimate the spacing of `count` points that farthest point sampling chooses from points of a surface.

    The spacing is the median distance to the nearest other point, in the unit of the points. It is measured on a random
    subsample of both the points and `count`, and scaled by the square root of the fraction, as on a surface. It does
    not depend on the order of the points.
    """
    fraction = max(1, min(SUBSAMPLE, count // MIN_SUBSAMPLE))
    drawn = np.random.default_rng(0).permutation(len(points))[: max(2, len(points) // fraction)]
    sample = points[np.lexsort(points.T[::-1])[drawn]]
    enough = len(sample) >= count // fraction
    chosen = sample[farthest_points(sample, max(2, count // fraction))] if enough else sample
    distance = cKDTree(chosen).query(chosen, k=[2])[0]
    return float(np.median(distance) / fraction**0.5)
