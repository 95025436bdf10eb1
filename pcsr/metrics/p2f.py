"""Point-to-face distance: distances of predicted points to the true surface (P2F of PU-GAN)."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import RunError, UserError

BLOCK = 2048
"""Points that are looked up at once. It bounds the memory."""
PAIRS = 1 << 18
"""Approximate number of pairs of a point and a candidate triangle that are compared at once. It bounds the memory."""
PIECES = 1 << 17
"""Number of triangles at which the subdivision of long triangles stops."""
GROUPS = 6
"""Number of groups of triangles of similar size, each with its own k-d tree and search radius."""


def point_to_surface(
    points: Float[np.ndarray, "n 3"], vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> Float[np.ndarray, " n"]:
    """Compute the exact distance of each point to the nearest triangle of a mesh.

    A triangle can only be the nearest if its bounding sphere is no farther than the nearest corner of the mesh. k-d
    trees of the spheres' centres find these triangles. Long triangles are subdivided first, since their spheres would
    contain most of the cloud.

    Args:
        points: the predicted cloud.
        vertices: vertices of the mesh, in the frame of the cloud.
        faces: indices of the corners of each triangle.

    Returns:
        Distances in the coordinates' unit, not squared.

    Raises:
        UserError: the mesh has no faces.
        RunError: a coordinate is not finite.

    Examples:
        >>> vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        >>> faces = np.array([[0, 1, 2]])
        >>> point_to_surface(np.array([[0.25, 0.25, 0.5], [0.0, 3.0, 0.0]]), vertices, faces)
        array([0.5, 2. ])
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
            # Slightly larger than the bound, so that rounding errors exclude nothing.
            reach = (best + radius[group].max()) * (1 + 1e-9)
            for point, member in _within(tree, block, reach):
                piece = group[member]
                # A triangle is no nearer than its plane. This excludes most triangles where all points coincide.
                height = np.abs(np.einsum("nj,nj->n", block[point] - triangles[piece, 0], normal[piece]))
                close = height <= best[point] + 1e-9 * reach[point]
                point, piece = point[close], piece[close]
                np.minimum.at(best, point, _to_triangle(block[point], triangles[piece]))
        nearest[start : start + BLOCK] = best
    return nearest


def _within(
    tree: cKDTree, block: Float[np.ndarray, "n 3"], reach: Float[np.ndarray, " n"]
) -> Iterator[tuple[Int[np.ndarray, " r"], Int[np.ndarray, " r"]]]:
    """Yield all pairs of a point and a centre within the point's reach, about `PAIRS` at a time."""
    count = tree.query_ball_point(block, reach, return_length=True)
    part = (np.cumsum(count) - 1) // PAIRS
    for rows in np.split(np.arange(len(block)), np.flatnonzero(np.diff(part)) + 1):
        found = tree.query_ball_point(block[rows], reach[rows], return_sorted=False)
        yield np.repeat(rows, count[rows]), np.concatenate(found).astype(np.int64)


def _spheres(
    triangles: Float[np.ndarray, "f 3 3"],
) -> tuple[Float[np.ndarray, "f 3"], Float[np.ndarray, " f"]]:
    """Return centres and radii of bounding spheres of triangles, centred on their centroids."""
    centre = triangles.mean(1)
    return centre, np.linalg.norm(triangles - centre[:, None], axis=2).max(1)


def _unit_normals(triangles: Float[np.ndarray, "f 3 3"]) -> Float[np.ndarray, "f 3"]:
    """Return unit normals of triangles.

    The normal of a thin triangle is not exact enough to exclude it by its plane, and is returned as zero.
    """
    edges = np.roll(triangles, -1, 1) - triangles
    normal = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    wide = size > 1e-6 * np.einsum("nij,nij->ni", edges, edges).max(1, keepdims=True)
    unit: Float[np.ndarray, "f 3"] = np.where(wide, normal / np.where(wide, size, 1), 0)
    return unit


def _cut(triangles: Float[np.ndarray, "f 3 3"], count: int) -> Float[np.ndarray, "pieces 3 3"]:
    """Bisect long triangles at their longest edges until none is long or there are `PIECES`.

    A triangle is long if the radius of its bounding sphere is more than twice the square root of the area per point of
    `count` evenly spaced points.
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
    """Return the distance of each point to its triangle: to the plane if it projects inside, else to the edges."""
    edges = np.roll(t, -1, 1) - t
    to_p = p[:, None] - t
    length = np.einsum("nij,nij->ni", edges, edges)
    along = np.clip(np.einsum("nij,nij->ni", to_p, edges) / np.maximum(length, 1e-300), 0, 1)
    to_edge = np.linalg.norm(to_p - along[..., None] * edges, axis=2).min(1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normal, axis=1)
    wide = size > 1e-12 * length.max(1)  # the normal of a thinner triangle is noise, and its edges are all of it
    sides = np.einsum("nij,nj->ni", np.cross(edges, to_p), normal)
    inside = wide & (sides >= 0).all(1)
    height = np.abs(np.einsum("nj,nj->n", to_p[:, 0], normal)) / np.where(wide, size, 1)
    distance: Float[np.ndarray, " n"] = np.where(inside, np.minimum(height, to_edge), to_edge)
    return distance
