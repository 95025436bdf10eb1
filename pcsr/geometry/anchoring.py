"""A dense cloud of the right number of points, evenly spaced, with touched points kept exactly where they are."""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.farthest import farthest_points

SAMPLE = 16
"""How far apart kept points will lie is estimated from one point in so many,"""
ENOUGH = 64
"""but from no fewer than so many of them: in a small part most points lie at its border."""
APART = 0.9
"""Touched points that are kept are at least so many of these distances apart: a dense touch is no reason to have more
points there, and fewer elsewhere."""
CLEAR = 1.0
"""What was made within so many of these distances of a touched point gives way to it."""


def even_subset(points: Float[np.ndarray, "n 3"], count: int, touched: int = 0) -> Int[np.ndarray, " count"]:
    """Indices of the `count` points that are farthest from each other, touched points among them.

    A touched point is known, others near it are guessed: they go first. What is then farthest from each other is
    kept, of both kinds. If too few would be left, the guessed ones that are farthest from any touched one stay.

    Args:
        points: more than are wanted, in any frame.
        count: how many to keep.
        touched: so many of the first points were touched.

    Raises:
        UserError: there are fewer than `count` points.
    """
    if not touched or not np.isfinite(points).all():  # a network that diverged: metrics say so
        return farthest_points(points, count)
    guessed = len(points) - touched
    gap = spacing(points[touched:] if guessed > 1 else points, count)
    apart = farthest_points(points[:touched], touched)
    apart = apart[: max(first_apart(points[apart], APART * gap), count - guessed)]
    tree = cKDTree(points[:touched])
    clear = np.flatnonzero(np.isinf(tree.query(points[touched:], distance_upper_bound=CLEAR * gap)[0]))
    if len(apart) + len(clear) < count:
        clear = tree.query(points[touched:])[0].argsort(kind="stable")[len(apart) - count :]
    left = np.concatenate([apart, touched + clear])
    kept: Int[np.ndarray, " count"] = left[farthest_points(points[left], count)]
    return kept


def first_apart(ordered: Float[np.ndarray, "n 3"], gap: float) -> int:
    """How many of the first points, each the farthest from those before it, are at least `gap` from each other."""
    low, high = 1, len(ordered)
    while low < high:
        middle = (low + high + 1) // 2
        nearest = cKDTree(ordered[:middle]).query(ordered[:middle], k=[2])[0].min()
        low, high = (middle, high) if nearest >= gap else (low, middle - 1)
    return low


def spacing(points: Float[np.ndarray, "n 3"], count: int) -> float:
    """About how far apart the `count` farthest of the points of a surface are, in their unit.

    From a part of both numbers: on a surface the distance falls with the root of the number. It does not depend on the
    order of the points.
    """
    part = max(1, min(SAMPLE, count // ENOUGH))
    drawn = np.random.default_rng(0).permutation(len(points))[: max(2, len(points) // part)]
    few = points[np.lexsort(points.T[::-1])[drawn]]
    chosen = few[farthest_points(few, max(2, count // part))] if len(few) >= count // part else few
    near = cKDTree(chosen).query(chosen, k=[2])[0]
    return float(np.median(near) / part**0.5)
