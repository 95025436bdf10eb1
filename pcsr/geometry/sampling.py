"""Drawing points: from a surface, evenly or not, and from a cloud."""

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError

CANDIDATES = 5
"""Random points drawn for each blue-noise point that is kept."""


def surface_points(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> Float[np.ndarray, "count 3"]:
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
    weight = np.where(weight.sum(1, keepdims=True) > 1, 1 - weight, weight)  # fold the square onto the triangle
    points: Float[np.ndarray, "count 3"] = triangles[face, 0] + np.einsum("nk,nkd->nd", weight, edges[face])
    return points


def poisson_points(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> Float[np.ndarray, "count 3"]:
    """Exactly `count` blue-noise points of a surface: none much nearer to another than all the rest.

    Random candidates thinned as in `poisson_subset`.
    """
    candidates = surface_points(mesh, CANDIDATES * count, rng)
    return candidates[poisson_subset(candidates, count, rng)]


def poisson_subset(
    points: Float[np.ndarray, "n 3"], count: int, rng: np.random.Generator
) -> Int[np.ndarray, " count"]:
    """Indices of exactly `count` points that keep as large a distance from each other as goes.

    Dart throwing, all darts at once: a point stays if no point of higher (random) rank within the radius stays.
    The radius is searched by bisection until slightly more than `count` stay; the last ranks of those go.

    Raises:
        UserError: there are fewer than `count` points.
    """
    if count > len(points):
        raise UserError(f"{count} points were asked of a cloud of {len(points)}")
    rank = rng.permutation(len(points))
    tree = cKDTree(points)
    spacing = tree.query(points, k=2)[0][:, 1].mean()
    low, high = 0.0, np.inf
    radius = 1.4 * spacing * (len(points) / count) ** 0.5  # about right on a surface of random points
    kept = np.arange(len(points))
    for _ in range(20):
        trial = _throw(tree, rank, radius)
        if len(trial) >= count:
            low, kept = radius, trial
            if len(trial) <= 1.005 * count:
                break
        else:
            high = radius
        radius = 1.1 * low if np.isinf(high) else max((low + high) / 2, high / 1.1)
    return kept[np.argsort(rank[kept])[:count]]


def _throw(tree: cKDTree, rank: Int[np.ndarray, " n"], radius: float) -> Int[np.ndarray, " kept"]:
    """The points that survive at one radius, whatever the order in which the pairs are looked at."""
    pairs = tree.query_pairs(radius, output_type="ndarray")
    first = np.where(rank[pairs[:, 0]] < rank[pairs[:, 1]], pairs[:, 0], pairs[:, 1])
    second = pairs.sum(1) - first
    alive = np.ones(len(rank), bool)
    undecided = alive.copy()
    while len(first):
        # A point that nobody undecided outranks stays, and those that it outranks go.
        outranked = np.zeros(len(rank), bool)
        outranked[second] = True
        stays = undecided & ~outranked
        alive[second[stays[first]]] = False
        undecided &= alive & ~stays
        open_pairs = undecided[first] & undecided[second]
        first, second = first[open_pairs], second[open_pairs]
    return np.flatnonzero(alive)


def farthest_points(points: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, " count"]:
    """Farthest point sampling: each point the one farthest from all before it. Exact.

    The first is the point farthest from the centroid, so that the result does not depend on the order of the
    points (up to exact ties).

    Raises:
        UserError: there are fewer than `count` points.
    """
    n = len(points)
    if count > n:
        raise UserError(f"{count} points were asked of a cloud of {n}")
    x, y, z = np.ascontiguousarray((points - points.mean(0)).T, dtype=np.float32)
    nearest = np.full(n, np.inf, np.float32)
    chosen = np.zeros(count, np.int64)
    chosen[0] = np.argmax(x * x + y * y + z * z)
    distance, term = np.zeros(n, np.float32), np.zeros(n, np.float32)
    for i in range(1, count):
        last = chosen[i - 1]
        np.subtract(x, x[last], out=distance)
        np.multiply(distance, distance, out=distance)
        for axis in (y, z):
            np.subtract(axis, axis[last], out=term)
            np.multiply(term, term, out=term)
            np.add(distance, term, out=distance)
        np.minimum(nearest, distance, out=nearest)
        chosen[i] = nearest.argmax()
    return chosen
