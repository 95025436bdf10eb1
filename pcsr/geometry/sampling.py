"""Drawing points from a surface, evenly or not; and an even part of a cloud."""

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
FEW, CLOSE = 20, 0.03
"""How far apart points are is guessed from one in so many, and known to be within this part of the guess."""


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
    face = face_by_area(np.cumsum(area) / total, rng.random(count))
    return point_of_face(triangles[face, 0], edges[face], rng.random((count, 2)))


def face_by_area(
    cumulated: Float[np.ndarray, " faces"], uniform: Float[np.ndarray, " count"]
) -> Int[np.ndarray, " count"]:
    """Indices of faces, each drawn with a probability in proportion to its area.

    Args:
        cumulated: cumulative share of the surface's area, face by face.
        uniform: random numbers in [0, 1).
    """
    return np.searchsorted(cumulated, uniform, side="right").clip(max=len(cumulated) - 1)


def point_of_face(
    corners: Float[np.ndarray, "count 3"], edges: Float[np.ndarray, "count 2 3"], uniform: Float[np.ndarray, "count 2"]
) -> Float[np.ndarray, "count 3"]:
    """One random point of each triangle, uniform by area.

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
        # On a surface the number falls with the square of the radius.
        guess = radius * (len(trial) / ((1 + SURPLUS / 2) * count)) ** 0.5
        radius = guess if low < guess < high else (low + high) / 2
    return kept[np.argsort(rank[kept])[:count]]


class _Darts:
    """Darts that are thrown at one cloud with several radii: its pairs are looked for once, at the widest."""

    def __init__(self, points: Float[np.ndarray, "n 3"], rank: Int[np.ndarray, " n"]) -> None:
        self._tree, self._rank = cKDTree(points, balanced_tree=False), rank
        self._widest = -math.inf

    def throw(self, radius: float) -> Int[np.ndarray, " kept"]:
        """The points that survive at one radius, whatever the order in which the pairs are looked at."""
        first, second = self._pairs(radius)
        alive = np.ones(len(self._rank), bool)
        while len(first):
            # A point that nobody alive outranks stays, and those that it outranks go.
            outranked = np.zeros(len(alive), bool)
            outranked[second] = True
            alive[second[~outranked[first]]] = False
            undecided = alive[first] & alive[second]
            first, second = first[undecided], second[undecided]
        return np.flatnonzero(alive)

    def likely_radius(self, count: int) -> float:
        """About the right radius on an evenly sampled surface; elsewhere a start."""
        tree = self._tree
        k = min(tree.n // count, 16)
        wider = 1.4 * (tree.n / count / k) ** 0.5
        typical = self._median_gap(k, wider)
        if typical is None:
            gap = tree.query(tree.data, k=[k + 1])[0]
            typical = np.median(gap) or gap.mean() or np.ptp(tree.data, axis=0).max() / tree.n
        return float(wider * typical)

    def _median_gap(self, k: int, wider: float) -> float | None:
        """The distance that half of the points have to their k-th neighbour, where a few tell nearly what it is.

        Then only those are asked for theirs that may be in the middle. The pairs show which: they are looked for as
        widely as they will be needed, `wider` times as far.
        """
        tree = self._tree
        guess = np.median(tree.query(tree.data[::FEW], k=[k + 1])[0])
        if not 0 < guess < math.inf:
            return None
        low, high = (1 - CLOSE) * guess, (1 + CLOSE) * guess
        self._look(wider * high)
        less, enough = (np.bincount(np.concatenate(self._pairs(at)), minlength=tree.n) >= k for at in (low, high))
        gap = np.where(less, 0.0, math.inf)
        middle = np.flatnonzero(enough & ~less)
        gap[middle] = tree.query(tree.data[middle], k=[k + 1])[0][:, 0]
        typical = float(np.median(gap))
        return typical if low <= typical <= high else None

    def _pairs(self, radius: float) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
        """The points of all pairs that are as near as that, those of higher rank first."""
        if radius > self._widest:
            self._look(radius)
        near = self._squared <= radius * radius
        return self._first[near], self._second[near]

    def _look(self, radius: float) -> None:
        a, b = self._tree.query_pairs(radius, output_type="ndarray").T.copy()
        higher = self._rank[a] < self._rank[b]
        self._first, self._second = np.where(higher, a, b), np.where(higher, b, a)
        self._squared = sum((axis[a] - axis[b]) ** 2 for axis in self._tree.data.T.copy())
        self._widest = radius
