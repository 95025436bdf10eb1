"""Drawing points: from a surface, evenly or not, and from a cloud."""

import math

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError

CANDIDATES = 5
"""Random points drawn for each blue-noise point that is kept."""
SURPLUS = 0.005
"""The radius of a blue-noise cloud is good enough when at most this part of its points is too many."""
TRIALS = 30
"""Radii tried for that."""


def surface_points(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Random points of a surface, uniform by area, in the mesh's frame and unit.

    Raises:
        UserError: the surface has no area.
    """
    triangles = np.asarray(mesh.triangles, np.float64)
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    total = area.sum()
    if not (np.isfinite(total) and total > 0):
        raise UserError(f"the mesh has {len(triangles)} triangles of area {total / 2:g} in all: nothing to sample")
    face = np.searchsorted(np.cumsum(area) / total, rng.random(count), side="right").clip(max=len(area) - 1)
    weight = rng.random((count, 2))
    outside = weight.sum(1, keepdims=True) > 1
    weight = np.where(outside, 1 - weight, weight)  # fold the square onto the triangle
    points: Float[np.ndarray, "count 3"] = triangles[face, 0] + np.einsum("nk,nkd->nd", weight, edges[face])
    return points


def poisson_points(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Exactly `count` blue-noise points of a surface: none much nearer to another than all the rest.

    Random candidates thinned as in `poisson_subset`; in the mesh's frame and unit.

    Raises:
        UserError: the surface has no area.
    """
    candidates = surface_points(mesh, CANDIDATES * count, rng)
    chosen: Float[np.ndarray, "count 3"] = candidates[poisson_subset(candidates, count, rng)]
    return chosen


def poisson_subset(points: Float[np.ndarray, "n 3"], count: int, rng: np.random.Generator) -> Int[np.ndarray, " count"]:
    """Indices of exactly `count` points that keep about as large a distance from each other as goes.

    Dart throwing, all darts at once: a point stays if no point of higher (random) rank near it stays.
    The radius is searched until slightly more than `count` stay; the last ranks of those go.

    Raises:
        UserError: there are fewer than `count` points.
    """
    n = len(points)
    if count > n:
        raise UserError(f"{count} points were asked of a cloud of {n}: ask for fewer")
    rank = rng.permutation(n)
    kept = np.arange(n)
    if count == n or count == 0:
        return kept[:count]
    tree = cKDTree(points)
    low, high = 0.0, math.inf
    radius = _likely_radius(tree, count)
    for _ in range(TRIALS):
        trial = _throw(tree, rank, radius)
        if len(trial) < count:
            high = radius
        else:
            low, kept = radius, trial
            if len(trial) <= (1 + SURPLUS) * count:
                break
        # On a surface the number falls with the square of the radius.
        guess = radius * (len(trial) / ((1 + SURPLUS / 2) * count)) ** 0.5
        radius = guess if low < guess < high else (low + high) / 2
    return kept[np.argsort(rank[kept])[:count]]


def _likely_radius(tree: cKDTree, count: int) -> float:
    """About the right radius on an evenly sampled surface; elsewhere a start."""
    k = min(tree.n // count, 16)
    gap = tree.query(tree.data, k=[k + 1])[0]
    typical = np.median(gap) or gap.mean() or np.ptp(tree.data, axis=0).max() / tree.n
    return float(1.4 * typical * (tree.n / count / k) ** 0.5)


def _throw(tree: cKDTree, rank: Int[np.ndarray, " n"], radius: float) -> Int[np.ndarray, " kept"]:
    """The points that survive at one radius, whatever the order in which the pairs are looked at."""
    pairs = tree.query_pairs(radius, output_type="ndarray")
    first = np.where(rank[pairs[:, 0]] < rank[pairs[:, 1]], pairs[:, 0], pairs[:, 1])
    second = pairs.sum(1) - first
    alive = np.ones(len(rank), bool)
    while len(first):
        # A point that nobody alive outranks stays, and those that it outranks go.
        outranked = np.zeros(len(rank), bool)
        outranked[second] = True
        alive[second[~outranked[first]]] = False
        undecided = alive[first] & alive[second]
        first, second = first[undecided], second[undecided]
    return np.flatnonzero(alive)


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
    chosen = np.zeros(count, np.int64)
    if count == 0:
        return chosen
    by_place = np.lexsort(points.T[::-1])
    cloud = np.asarray(points, np.float64)[by_place]
    gaps = Gaps(cloud, np.full(n, np.inf, np.float32))
    last = gaps.farthest_from_middle if start is None else int(np.flatnonzero(by_place == start)[0])
    chosen[0] = last
    for i in range(1, count):
        last = chosen[i] = gaps.take(last)
    return by_place[chosen]


class Gaps:
    """How far each point of a cloud is from all that were taken: the inner loop of farthest point sampling."""

    def __init__(self, cloud: Float[np.ndarray, "n 3"], squared: Float[np.ndarray, " n"]) -> None:
        """Begin.

        Args:
            cloud: the points, in any frame; their differences are looked at in single precision.
            squared: of each point to what is taken before the first; it is changed.
        """
        self._axes = np.ascontiguousarray((cloud - cloud.mean(0)).T, np.float32)
        self.squared = squared
        self._distance, self._term = np.zeros((2, len(cloud)), np.float32)

    @property
    def farthest_from_middle(self) -> int:
        """The point that is farthest from the cloud's mean."""
        x, y, z = self._axes
        return int(np.argmax(x * x + y * y + z * z))

    def take(self, last: int) -> int:
        """Take a point; the one that is then farthest from all taken ones."""
        distance, term = self._distance, self._term
        for number, axis in enumerate(self._axes):
            into = term if number else distance
            np.subtract(axis, axis[last], out=into)
            np.multiply(into, into, out=into)
            if number:
                np.add(distance, term, out=distance)
        np.minimum(self.squared, distance, out=self.squared)
        self.squared[last] = -1  # never twice, even where all that is left coincides with taken ones
        return int(self.squared.argmax())
