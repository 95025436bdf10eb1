"""Rays against a mesh in millimetres: Embree finds the triangle, float64 finds the point on it."""

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float

from pcsr import UserError


class MeshRays:
    """A mesh scaled so that the longest side of its bounding box is `object_size` mm, centred on the origin.

    Faces are solid from both sides: neither their order nor a hole in the mesh matters.

    Raises:
        UserError: the mesh has no area, or a coordinate is not finite.
    """

    def __init__(self, mesh: trimesh.Trimesh, object_size: float | None, name: str) -> None:
        corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces, np.int64)]
        if not len(corners):
            raise UserError(f"{name}: the mesh has no faces, so there is nothing to touch: leave it out")
        if not np.isfinite(corners).all():
            raise UserError(f"{name}: the mesh has a coordinate that is not finite: repair it or leave it out")
        low, high = corners.min((0, 1)), corners.max((0, 1))
        extent = float((high - low).max())
        scale = 1.0 if object_size is None or extent == 0 else object_size / extent
        triangles = (corners - (low + high) / 2) * scale
        self.to_object: Float[np.ndarray, "4 4"] = np.diag([1 / scale, 1 / scale, 1 / scale, 1.0])
        """Millimetres about the centre to the mesh's own frame and unit."""
        self.to_object[:3, 3] = (low + high) / 2
        self.size = extent * scale
        """Longest side of the bounding box, in mm."""
        self.reach = float(np.linalg.norm(high - low)) * scale
        """Length of the bounding box's diagonal, in mm: from there on, everything is outside."""

        self._corners = triangles[:, 0].copy()
        self._edges = (triangles[:, 1:] - triangles[:, :1]).transpose(1, 0, 2).copy()
        cross = np.cross(*self._edges)
        double = np.linalg.norm(cross, axis=1)
        if not double.sum() > 0:
            raise UserError(f"{name}: the mesh has no area, so there is nothing to touch: leave it out")
        self._normals = cross / np.where(double > 0, double, 1)[:, None]
        self._cumulated = np.cumsum(double) / double.sum()
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, triangles.astype(np.float32))

    def places(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, "places 3"], Float[np.ndarray, "places 3"]]:
        """Points of the surface, uniform by area, in mm, and the unit normals of their faces."""
        at = np.searchsorted(self._cumulated, rng.random(count), side="right")
        faces = np.minimum(at, len(self._cumulated) - 1)
        u, v = rng.random((2, count))
        folded = u + v > 1
        u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
        across = u[:, None] * self._edges[0, faces] + v[:, None] * self._edges[1, faces]
        return self._corners[faces] + across, self._normals[faces]

    def heights(self, places: Float[np.ndarray, "p 3"], axes: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " p"]:
        """How high above each place, along its axis, the object begins for who comes from far outside.

        Args:
            places: in mm, near the object.
            axes: unit vectors that point away from the object.

        Returns:
            Heights in mm, negative below the place, -inf where the object is not met at all.
        """
        start = places + axes * self.reach
        faces = self._scene.run(start.astype(np.float32), -np.ascontiguousarray(axes, np.float32))
        hit = np.flatnonzero(faces >= 0)
        faces, up = faces[hit], axes[hit]
        # Embree is float32. The triangle's plane gives the height in float64; the triangle's corners bound
        # it, as on a wall seen edge-on the plane alone may lead far off the triangle.
        corner, normals = self._corners[faces] - places[hit], self._normals[faces]
        a = _dot(corner, up)
        b, c = a + _dot(self._edges[0, faces], up), a + _dot(self._edges[1, faces], up)
        steepness = _dot(normals, up)
        on_plane = _dot(corner, normals) / np.where(np.abs(steepness) > 1e-12, steepness, 1e-12)
        heights = np.full(len(places), -np.inf)
        heights[hit] = np.clip(on_plane, np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c))
        return heights


def _dot(a: Float[np.ndarray, "p 3"], b: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " p"]:
    dots: Float[np.ndarray, " p"] = np.einsum("pj,pj->p", a, b)
    return dots
