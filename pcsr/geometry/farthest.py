"""Farthest point sampling: each point the one farthest from all before it."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError

SMALL = 16_384
"""In a cloud of at most so many points all are looked at for each that is taken: boxes would save nothing."""
ALONE = 64
"""So are they for the first few of a larger cloud, since each of those changes most distances."""
ROUND = 0.97
"""Then a round looks for the next ones among those whose squared distance is above this share of the greatest,"""
MOST = 1024
"""and among no more than so many: where points lie in a lattice, all may be equally far."""
FAN = 16
"""Boxes in a box, and points in the smallest."""

Bounds = tuple[Float32[np.ndarray, "3 _ _"], Float32[np.ndarray, "3 _ _"]]


def farthest_points(
    points: Float[np.ndarray, "n 3"], count: int, start: int | None = None
) -> Int[np.ndarray, " count"]:
    """Farthest point sampling: each point the one farthest from all before it.

    Which points are chosen does not depend on their order: the first is the one farthest from the centroid,
    and of equally far ones the first by x, then y, then z is taken. Distances are compared in float32, after
    the centroid was subtracted.

    Args:
        points: a cloud; points may coincide.
        count: how many to choose.
        start: index of the first; by default the point farthest from the centroid.

    Raises:
        UserError: there are fewer than `count` points, or no point `start`.
    """
    n = len(points)
    if not 0 <= count <= n:
        raise UserError(f"{count} points were asked of a cloud of {n}: ask for fewer")
    if start is not None and not 0 <= start < n:
        raise UserError(f"farthest points cannot start at point {start} of a cloud of {n}")
    if count == 0:
        return np.zeros(0, np.int64)
    by_place = np.lexsort(points.T[::-1])
    cloud = np.asarray(points, np.float64)[by_place]
    axes = np.ascontiguousarray((cloud - cloud.mean(0)).T, np.float32)
    first = np.add.reduce(axes * axes, 0).argmax() if start is None else np.flatnonzero(by_place == start)[0]
    return by_place[np.fromiter(_one_by_one(axes, int(first)), np.int64, count)]


def _one_by_one(axes: Float32[np.ndarray, "3 n"], first: int) -> Iterator[int]:
    """All points, each the one farthest from all before it; of equally far ones the first."""
    n = axes.shape[1]
    far = np.full(n, np.inf, np.float32)
    alone = ALONE if n > SMALL else n
    # What is not finite can't be put into boxes.
    while alone > 0 or not far[first] < np.inf:
        yield first
        first = _take(first, axes, far)
        alone -= 1
    yield from _in_rounds(axes, far)


def _take(point: int, axes: Float32[np.ndarray, "3 n"], far: Float32[np.ndarray, " n"]) -> int:
    """Take a point, so that others are less far; which of them is then the farthest."""
    apart = axes - axes[:, point, None]
    apart *= apart
    np.minimum(far, np.add.reduce(apart, 0), out=far)
    far[point] = -1  # never twice, even where all that is left coincides with taken ones
    return int(far.argmax())


def _in_rounds(axes: Float32[np.ndarray, "3 n"], far: Float32[np.ndarray, " n"]) -> Iterator[int]:
    """As `_take` again and again, exactly, but the next point is looked for among the few farthest.

    Distances only fall. So as long as one of these few is farther than all others were at the beginning of the round,
    it is the farthest of all. What the others' distances have become is looked up once a round, and only in boxes that
    the new points are near to, as in QuickFPS (Han et al., IEEE TCAD 2023), which does that for each point alone.

    Args:
        axes: the points.
        far: squared distance of each to the nearest that was taken; -1 for those.
    """
    # Points of a leaf are in a row: so are those of a box.
    place = cKDTree(axes.T, leafsize=FAN, balanced_tree=False, compact_nodes=False).indices
    axes, far = axes[:, place], np.append(far[place], np.full(-len(place) % FAN, -1, np.float32))
    boxes = _boxes(axes)
    while (top := far.max()) > 0:
        least = ROUND * top
        few, last = np.flatnonzero(far > least), -1
        if len(few) > MOST:
            few = few[np.lexsort((place[few], -far[few]))[:MOST]]
            least, last = far[few[-1]], place[few[-1]]
        few = few[place[few].argsort()]  # as they were handed in: the first of equals is taken
        near, left = axes[:, few], far[few]
        taken, at = [], int(left.argmax())
        # Of the others those that are as far as `least` come after the point `last`.
        while left[at] > least or (left[at] == least and place[few[at]] <= last):
            yield int(place[few[at]])
            taken.append(at)
            at = _take(at, near, left)
        points, squared = _around(axes[:, few[taken]], boxes, top)
        np.minimum.at(far, points, squared)
        far[few[taken]] = -1
    # All that is left coincides with taken ones.
    yield from np.sort(place[np.flatnonzero(far == 0)]).tolist()


def _boxes(axes: Float32[np.ndarray, "3 n"]) -> list[Bounds]:
    """Lower and upper bounds of the boxes in each box, from the one that holds all down to the points themselves."""
    levels: list[Bounds] = []
    low = high = axes
    while low.shape[1] > 1 or not levels:
        missing = (0, 0), (0, -low.shape[1] % FAN)
        inside = (np.pad(low, missing, constant_values=np.inf), np.pad(high, missing, constant_values=-np.inf))
        levels.append((inside[0].reshape(3, -1, FAN), inside[1].reshape(3, -1, FAN)))
        low, high = levels[-1][0].min(2), levels[-1][1].max(2)
    return levels[::-1]


def _around(
    centres: Float32[np.ndarray, "3 c"], boxes: list[Bounds], top: np.float32
) -> tuple[Int[np.ndarray, " found"], Float32[np.ndarray, " found"]]:
    """Points nearer to a centre than the root of `top`, once for each such centre, and their squared distances.

    Rounding is monotone: no box is farther than a point in it, and none is missed.
    """
    centre, inside = np.arange(centres.shape[1]), np.zeros(centres.shape[1], np.int64)
    for low, high in boxes:
        at = centres.take(centre, 1)[:, :, None]
        apart = np.maximum(low.take(inside, 1) - at, at - high.take(inside, 1))
        np.maximum(apart, 0, out=apart)
        apart *= apart
        squared = np.add.reduce(apart, 0)
        row, child = np.nonzero(squared < top)
        centre, inside = centre[row], FAN * inside[row] + child
    return inside, squared[row, child]
