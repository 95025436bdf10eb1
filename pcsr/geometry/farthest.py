"""Farthest point sampling, exact and fast for large clouds."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError

PLAIN_SIZE = 16_384
"""Clouds of up to 16,384 points are sampled by the plain algorithm, which updates all distances for each point."""
PLAIN_STEPS = 64
"""The first 64 points of a larger cloud are chosen by the plain algorithm: each of them changes most distances."""
ROUND_SHARE = 0.97
"""A round considers the points whose squared distance is above this share of the current maximum."""
ROUND_SIZE = 1024
"""A round considers at most 1024 points. On a lattice all distances may be equal."""
BOX_SIZE = 16
"""Number of children of each box, and of points of each leaf."""

Bounds = tuple[Float32[np.ndarray, "3 _ _"], Float32[np.ndarray, "3 _ _"]]
"""Lower and upper corners of the children of each box."""


def farthest_points(
    points: Float[np.ndarray, "n 3"], count: int, start: int | None = None
) -> Int[np.ndarray, " count"]:
    """Choose points by farthest point sampling: each is the one farthest from all points chosen before it.

    The choice does not depend on the order of the points: the first is the one farthest from the centroid, and among
    equally far points the first by x, y and z is chosen. Distances are compared in float32, after the centroid is
    subtracted.

    Args:
        points: the cloud; points may coincide.
        count: number of points to choose.
        start: index of the first point; by default the one farthest from the centroid.

    Returns:
        Indices of the chosen points, in the order of choice.

    Raises:
        UserError: there are fewer than `count` points, or `start` is no index.

    Examples:
        >>> line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0]])
        >>> farthest_points(line, 3)
        array([3, 0, 2])
    """
    n = len(points)
    if not 0 <= count <= n:
        raise UserError(f"{count} points were asked of a cloud of {n}: ask for fewer")
    if start is not None and not 0 <= start < n:
        raise UserError(f"farthest point sampling cannot start at point {start} of a cloud of {n}: give 0 to {n - 1}")
    if count == 0:
        return np.zeros(0, np.int64)
    by_coordinates = np.lexsort(points.T[::-1])
    cloud = np.asarray(points, np.float64)[by_coordinates]
    axes = np.ascontiguousarray((cloud - cloud.mean(0)).T, np.float32)
    first = np.add.reduce(axes * axes, 0).argmax() if start is None else np.flatnonzero(by_coordinates == start)[0]
    return by_coordinates[np.fromiter(_farthest_first(axes, int(first)), np.int64, count)]


def _farthest_first(axes: Float32[np.ndarray, "3 n"], first: int) -> Iterator[int]:
    """Yield all points in the order of farthest point sampling; ties go to the lowest index."""
    n = axes.shape[1]
    squared = np.full(n, np.inf, np.float32)
    steps = PLAIN_STEPS if n > PLAIN_SIZE else n
    # Boxes need finite coordinates.
    while steps > 0 or not squared[first] < np.inf:
        yield first
        first = _choose(first, axes, squared)
        steps -= 1
    yield from _in_rounds(axes, squared)


def _choose(point: int, axes: Float32[np.ndarray, "3 n"], squared: Float32[np.ndarray, " n"]) -> int:
    """Update the squared distances in place for a newly chosen point, and return the point that is then farthest."""
    difference = axes - axes[:, point, None]
    difference *= difference
    np.minimum(squared, np.add.reduce(difference, 0), out=squared)
    squared[point] = -1  # so that no point is chosen twice, even where all others coincide with chosen ones
    return int(squared.argmax())


def _in_rounds(axes: Float32[np.ndarray, "3 n"], squared: Float32[np.ndarray, " n"]) -> Iterator[int]:
    """Yield the same points as repeated calls of `_choose`, searching the next point among a few candidates only.

    The candidates of a round are the points that are farthest at its beginning. Distances never increase: a candidate
    that is farther than all other points were at the beginning of the round is the farthest of all. The distances of
    the other points are updated once per round, and only in boxes near the new points, similar to QuickFPS (Han et
    al., IEEE TCAD 2023), which updates them after each point.

    Args:
        axes: coordinates of the points.
        squared: squared distance of each point to the nearest chosen point; -1 for chosen points.
    """
    # The points of a leaf are consecutive, and so are those of a box.
    original = cKDTree(axes.T, leafsize=BOX_SIZE, balanced_tree=False, compact_nodes=False).indices
    axes, squared = axes[:, original], np.append(squared[original], np.full(-len(original) % BOX_SIZE, -1, np.float32))
    boxes = _boxes(axes)
    while (top := squared.max()) > 0:
        least = ROUND_SHARE * top
        candidates, last = np.flatnonzero(squared > least), -1
        if len(candidates) > ROUND_SIZE:
            candidates = candidates[np.lexsort((original[candidates], -squared[candidates]))[:ROUND_SIZE]]
            least, last = squared[candidates[-1]], original[candidates[-1]]
        candidates = candidates[original[candidates].argsort()]  # original order, in which ties are resolved
        coordinates, left = axes[:, candidates], squared[candidates]
        chosen, at = [], int(left.argmax())
        # Other points with the squared distance `least` have an original index above `last`.
        while left[at] > least or (left[at] == least and original[candidates[at]] <= last):
            yield int(original[candidates[at]])
            chosen.append(at)
            at = _choose(at, coordinates, left)
        points, updated = _points_near(axes[:, candidates[chosen]], boxes, top)
        np.minimum.at(squared, points, updated)
        squared[candidates[chosen]] = -1
    # All other points coincide with chosen ones.
    yield from np.sort(original[np.flatnonzero(squared == 0)]).tolist()


def _boxes(axes: Float32[np.ndarray, "3 n"]) -> list[Bounds]:
    """Return lower and upper bounds of a tree of boxes, level by level from the root to the points."""
    levels: list[Bounds] = []
    low = high = axes
    while low.shape[1] > 1 or not levels:
        missing = (0, 0), (0, -low.shape[1] % BOX_SIZE)
        inside = (np.pad(low, missing, constant_values=np.inf), np.pad(high, missing, constant_values=-np.inf))
        levels.append((inside[0].reshape(3, -1, BOX_SIZE), inside[1].reshape(3, -1, BOX_SIZE)))
        low, high = levels[-1][0].min(2), levels[-1][1].max(2)
    return levels[::-1]


def _points_near(
    centres: Float32[np.ndarray, "3 c"], boxes: list[Bounds], top: np.float32
) -> tuple[Int[np.ndarray, " found"], Float32[np.ndarray, " found"]]:
    """Return the points closer to a centre than √`top`, once for each such centre, and their squared distances.

    Floating-point rounding is monotone, so the computed distance of a box never exceeds that of a point in it.
    """
    centre, inside = np.arange(centres.shape[1]), np.zeros(centres.shape[1], np.int64)
    for low, high in boxes:
        at = centres.take(centre, 1)[:, :, None]
        difference = np.maximum(low.take(inside, 1) - at, at - high.take(inside, 1))
        np.maximum(difference, 0, out=difference)
        difference *= difference
        squared = np.add.reduce(difference, 0)
        row, child = np.nonzero(squared < top)
        centre, inside = centre[row], BOX_SIZE * inside[row] + child
    return inside, squared[row, child]
