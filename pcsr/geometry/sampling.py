"""Random sampling of surfaces, uniform or blue-noise, and blue-noise subsets of clouds."""

import math

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError

__all__ = ["poisson_points", "poisson_subset", "surface_points"]

CANDIDATES = 5
"""Random points drawn for each blue-noise point that is kept."""
SURPLUS = 0.005
"""Relative surplus of points at which the search for the radius of a blue-noise cloud stops."""
TRIALS = 30
"""Most radii that are tried."""
SUBSAMPLE = 20
"""The median distance of neighbours is first estimated on every 20th point."""
TOLERANCE = 0.03
"""Relative error of this estimate that is allowed for in computing the exact median."""


def surface_points(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Draw random points from a surface, uniformly by area, in the mesh's frame and unit.

    Raises:
        UserError: the surface has no area.

    Examples:
        >>> points = surface_points(trimesh.creation.box([2, 2, 2]), 1000, np.random.default_rng(0))
        >>> points.shape
        (1000, 3)
        >>> np.allclose(np.abs(points).max(axis=1), 1)
        True
    """
    triangles = np.asarray(mesh.triangles, np.float64)
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    total = area.sum()
    if not (np.isfinite(total) and total > 0):
        raise UserError(f"the mesh has {len(triangles)} triangles of area {total / 2:g} in all: nothing to sample")
    face = face_by_area(np.cumsum(area) / total, rng.random(count))
    return point_of_face(triangles[face, 0], edges[face], rng.random((count, 2)))


def face_by_area(
    cumulated: Float[np.ndarray, " faces"], uniform: Float[np.ndarray, " count"]
) -> Int[np.ndarray, " count"]:
    """Draw indices of faces with probabilities proportional to their areas.

    Args:
        cumulated: cumulative share of the surface's area, face by face.
        uniform: random numbers in [0, 1).
    """
    return np.searchsorted(cumulated, uniform, side="right").clip(max=len(cumulated) - 1)


def point_of_face(
    corners: Float[np.ndarray, "count 3"], edges: Float[np.ndarray, "count 2 3"], uniform: Float[np.ndarray, "count 2"]
) -> Float[np.ndarray, "count 3"]:
    """Draw one random point of each triangle, uniform by area.

    Args:
        corners: first corner of each triangle.
        edges: vectors from there to the other two.
        uniform: random numbers in [0, 1); pairs beyond the diagonal of the square are folded back onto the triangle.
    """
    outside = uniform.sum(1, keepdims=True) > 1
    weight = np.where(outside, 1 - uniform, uniform)
    points: Float[np.ndarray, "count 3"] = corners + (weight[:, :1] * edges[:, 0] + weight[:, 1:] * edges[:, 1])
    return points


def poisson_points(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Draw exactly `count` blue-noise points from a surface, which keep a minimum distance from each other.

    They are chosen from random points by `poisson_subset`, in the mesh's frame and unit.

    Raises:
        UserError: the surface has no area.

    Examples:
        >>> poisson_points(trimesh.creation.box([2, 2, 2]), 100, np.random.default_rng(0)).shape
        (100, 3)
    """
    candidates = surface_points(mesh, CANDIDATES * count, rng)
    chosen: Float[np.ndarray, "count 3"] = candidates[poisson_subset(candidates, count, rng)]
    return chosen


def poisson_subset(points: Float[np.ndarray, "n 3"], count: int, rng: np.random.Generator) -> Int[np.ndarray, " count"]:
    """Choose exactly `count` points that keep about the largest possible distance from each other.

    This is parallel dart throwing: every point gets a random rank, and a point is kept if no kept point of higher rank
    lies within a radius. The radius is searched until slightly more than `count` points are kept; then the ones with
    the lowest ranks are dropped.

    Returns:
        Indices of the chosen points.

    Raises:
        UserError: there are fewer than `count` points.

    Examples:
        >>> from pcsr.geometry.sampling import poisson_subset
        >>> rng = np.random.default_rng(0)
        >>> len(set(poisson_subset(rng.normal(size=(500, 3)), 100, rng).tolist()))
        100
    """
    n = len(points)
    if count > n:
        raise UserError(f"{count} points were asked of a cloud of {n}: ask for fewer")
    rank = rng.permutation(n)
    kept = np.arange(n)
    if count == n or count == 0:
        return kept[:count]
    darts = _Darts(points, rank)
    low, high = 0.0, math.inf
    radius = darts.likely_radius(count)
    for _ in range(TRIALS):
        trial = darts.throw(radius)
        if len(trial) < count:
            high = radius
        else:
            low, kept = radius, trial
            if len(trial) <= (1 + SURPLUS) * count:
                break
        # On a surface the number of points falls with the square of the radius.
        guess = radius * (len(trial) / ((1 + SURPLUS / 2) * count)) ** 0.5
        radius = guess if low < guess < high else (low + high) / 2
    return kept[np.argsort(rank[kept])[:count]]


class _Darts:
    """Dart throwing on one cloud with several radii. Pairs of points are searched once, for the largest radius."""

    def __init__(self, points: Float[np.ndarray, "n 3"], rank: Int[np.ndarray, " n"]) -> None:
        self._tree, self._rank = cKDTree(points, balanced_tree=False), rank
        self._widest = -math.inf

    def throw(self, radius: float) -> Int[np.ndarray, " kept"]:
        """Return the indices of the points kept at one radius; they do not depend on the order of the pairs."""
        first, second = self._pairs(radius)
        alive = np.ones(len(self._rank), bool)
        while len(first):
            # A point without neighbours of higher rank is kept, and its neighbours are dropped.
            outranked = np.zeros(len(alive), bool)
            outranked[second] = True
            alive[second[~outranked[first]]] = False
            undecided = alive[first] & alive[second]
            first, second = first[undecided], second[undecided]
        return np.flatnonzero(alive)

    def likely_radius(self, count: int) -> float:
        """Estimate the radius at which `count` points are kept, assuming an evenly sampled surface."""
        tree = self._tree
        k = min(tree.n // count, 16)
        factor = 1.4 * (tree.n / count / k) ** 0.5
        median = self._median_distance(k, factor)
        if median is None:
            distance = tree.query(tree.data, k=[k + 1])[0]
            median = np.median(distance) or distance.mean() or np.ptp(tree.data, axis=0).max() / tree.n
        return float(factor * median)

    def _median_distance(self, k: int, factor: float) -> float | None:
        """Return the median distance of the points to their k-th neighbour; None if the first estimate is too far off.

        The median is estimated on a subsample first. The exact distance is then computed only for points whose distance
        may be close to the estimate. The other points are sorted out by their numbers of pairs, which are searched
        within `factor` times the estimate, as they will be needed later.
        """
        tree = self._tree
        guess = np.median(tree.query(tree.data[::SUBSAMPLE], k=[k + 1])[0])
        if not 0 < guess < math.inf:
            return None
        low, high = (1 - TOLERANCE) * guess, (1 + TOLERANCE) * guess
        self._search(factor * high)
        below, within = (np.bincount(np.concatenate(self._pairs(at)), minlength=tree.n) >= k for at in (low, high))
        distance = np.where(below, 0.0, math.inf)
        middle = np.flatnonzero(within & ~below)
        distance[middle] = tree.query(tree.data[middle], k=[k + 1])[0][:, 0]
        median = float(np.median(distance))
        return median if low <= median <= high else None

    def _pairs(self, radius: float) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
        """Return the indices of all pairs of points within a radius; the first of each pair has the higher rank."""
        if radius > self._widest:
            self._search(radius)
        within = self._squared <= radius * radius
        return self._first[within], self._second[within]

    def _search(self, radius: float) -> None:
        a, b = self._tree.query_pairs(radius, output_type="ndarray").T.copy()
        higher = self._rank[a] < self._rank[b]
        self._first, self._second = np.where(higher, a, b), np.where(higher, b, a)
        self._squared = sum((axis[a] - axis[b]) ** 2 for axis in self._tree.data.T.copy())
        self._widest = radius
