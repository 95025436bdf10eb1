"""Point to face: how far predicted points lie from the true surface (PU-GAN's P2F)."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import RunError, UserError

BLOCK = 2048
"""Points that are looked up at once, to bound the memory."""
PAIRS = 1 << 18
"""Pairs of a point and a candidate piece that are looked at at once, for the same reason."""
PIECES = 1 << 17
"""Long triangles are cut until there are about so many pieces, or none is long any more."""
GROUPS = 6
"""Groups of pieces of like size, each with a search radius of its own."""


def point_to_surface(
    points: Float[np.ndarray, "n 3"], vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> Float[np.ndarray, " n"]:
    """Distance of each point to the nearest triangle, not squared, in the unit of the coordinates. Exact.

    A triangle can be the nearest only if its bounding sphere comes as near as some corner does; a k-d tree
    of the spheres' centres finds those. Long triangles are cut first: their spheres enclose everything.

    Raises:
        UserError: the mesh has no faces.
        RunError: a coordinate is not finite.

    Examples:
        >>> vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
        >>> pcsr.metrics.point_to_surface(np.array([[0.2, 0.2, 0.5]]), vertices, faces).round(3)
        array([0.5])
    """
    if len(faces) == 0:
        raise UserError("p2f: the true mesh has no faces: give a mesh, or leave the metric out")
    if not (np.isfinite(points).all() and np.isfinite(vertices).all()):
        raise RunError(
            "p2f: a coordinate is not finite: if a network made the cloud, its training diverged; lower "
            "train.learning_rate"
        )
    triangles = _cut(np.asarray(vertices, np.float64)[faces], len(points))
    centre, radius = _spheres(triangles)
    normal = _unit_normals(triangles)
    corners = cKDTree(triangles.reshape(-1, 3))
    groups = np.array_split(np.argsort(radius), min(len(radius), GROUPS))
    trees = [cKDTree(centre[group]) for group in groups]
    cloud = np.asarray(points, np.float64)
    nearest = np.zeros(len(cloud))
    for start in range(0, len(cloud), BLOCK):
        block = cloud[start : start + BLOCK]
        distance, corner = corners.query(block)
        best = np.minimum(distance, _to_triangle(block, triangles[corner // 3]))
        for group, tree in zip(groups, trees, strict=True):
            # A little more than the bound, so that rounding excludes nothing.
            reach = (best + radius[group].max()) * (1 + 1e-9)
            for point, member in _within(tree, block, reach):
                piece = group[member]
                # A triangle is no nearer than its plane. That spares a cloud on one spot all triangles.
                height = np.abs(np.einsum("nj,nj->n", block[point] - triangles[piece, 0], normal[piece]))
                near = height <= best[point] + 1e-9 * reach[point]
                point, piece = point[near], piece[near]
                np.minimum.at(best, point, _to_triangle(block[point], triangles[piece]))
        nearest[start : start + BLOCK] = best
    return nearest


def _within(
    tree: cKDTree, block: Float[np.ndarray, "n 3"], reach: Float[np.ndarray, " n"]
) -> Iterator[tuple[Int[np.ndarray, " r"], Int[np.ndarray, " r"]]]:
    """Every pair of a point and a centre within its reach, in parts of about PAIRS."""
    count = tree.query_ball_point(block, reach, return_length=True)
    part = (np.cumsum(count) - 1) // PAIRS
    for rows in np.split(np.arange(len(block)), np.flatnonzero(np.diff(part)) + 1):
        found = tree.query_ball_point(block[rows], reach[rows], return_sorted=False)
        yield np.repeat(rows, count[rows]), np.concatenate(found).astype(np.int64)


def _spheres(
    triangles: Float[np.ndarray, "f 3 3"],
) -> tuple[Float[np.ndarray, "f 3"], Float[np.ndarray, " f"]]:
    """A sphere around each triangle: its centroid and the farthest corner."""
    centre = triangles.mean(1)
    return centre, np.linalg.norm(triangles - centre[:, None], axis=2).max(1)


def _unit_normals(triangles: Float[np.ndarray, "f 3 3"]) -> Float[np.ndarray, "f 3"]:
    """Zero for a thin triangle, whose normal is not exact enough: then its plane excludes nothing."""
    edges = np.roll(triangles, -1, 1) - triangles
    normal = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    wide = size > 1e-6 * np.einsum("nij,nij->ni", edges, edges).max(1, keepdims=True)
    unit: Float[np.ndarray, "f 3"] = np.where(wide, normal / np.where(wide, size, 1), 0)
    return unit


def _cut(triangles: Float[np.ndarray, "f 3 3"], count: int) -> Float[np.ndarray, "pieces 3 3"]:
    """The same surface with long triangles halved across their longest edge, again and again.

    A piece is small enough once it is twice the size of the patch that one of `count` even points stands for.
    """
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
    small = 2 * np.sqrt(area / max(count, 1))
    while len(triangles) < PIECES:
        long = _spheres(triangles)[1] > small
        if small == 0 or not long.any():
            break
        whole = triangles[long]
        longest = np.linalg.norm(np.roll(whole, -1, 1) - whole, axis=2).argmax(1)
        corner = (longest[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(whole, corner[..., None], 1), 1, 0)
        middle = (a + b) / 2
        halves = [np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)]
        triangles = np.concatenate([triangles[~long], *halves])
    return triangles


def _to_triangle(p: Float[np.ndarray, "n 3"], t: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Distance of each point to its own triangle: to the plane if it is above the inside, else to an edge."""
    edges = np.roll(t, -1, 1) - t
    to_p = p[:, None] - t
    length = np.einsum("nij,nij->ni", edges, edges)
    along = np.clip(np.einsum("nij,nij->ni", to_p, edges) / np.maximum(length, 1e-300), 0, 1)
    to_edge = np.linalg.norm(to_p - along[..., None] * edges, axis=2).min(1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normal, axis=1)
    wide = size > 1e-12 * length.max(1)  # a thinner triangle's normal is noise, and its edges are all of it
    sides = np.einsum("nij,nj->ni", np.cross(edges, to_p), normal)
    inside = wide & (sides >= 0).all(1)
    height = np.abs(np.einsum("nj,nj->n", to_p[:, 0], normal)) / np.where(wide, size, 1)
    distance: Float[np.ndarray, " n"] = np.where(inside, np.minimum(height, to_edge), to_edge)
    return distance
