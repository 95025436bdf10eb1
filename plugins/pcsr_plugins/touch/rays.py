"""Rays against a mesh in millimetres: Embree finds the triangle, float64 finds the point on it."""

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float

from pcsr import UserError


class MeshRays:
    """A mesh scaled so that its longest side measures `object_size` mm, centred on the origin."""

    def __init__(self, mesh: trimesh.Trimesh, object_size: float, name: str) -> None:
        extent = float(np.max(mesh.extents)) if len(mesh.faces) else 0.0
        if not (np.isfinite(extent) and extent > 0 and mesh.area > 0):
            raise UserError(f"{name}: the mesh has no surface to touch: it is empty, flat in every direction or not finite")
        scale = object_size / extent
        centre = mesh.bounds.mean(0)
        self.triangles = (np.asarray(mesh.vertices, np.float64) - centre)[mesh.faces] * scale
        """Corners of each triangle, in mm."""
        self.to_object = np.diag([1 / scale, 1 / scale, 1 / scale, 1.0])
        """Millimetres about the centre to the mesh's own frame and unit."""
        self.to_object[:3, 3] = centre
        self.reach = float(np.linalg.norm(mesh.extents)) * scale
        cross = np.cross(*(self.triangles[:, 1:] - self.triangles[:, :1]).transpose(1, 0, 2))
        area = np.linalg.norm(cross, axis=1)
        self._normals = cross / np.where(area > 0, area, 1)[:, None]
        self._upto = np.cumsum(area) / area.sum()
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, self.triangles.astype(np.float32))

    def place(self, rng: np.random.Generator) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """A point of the surface, uniform by area, and its outward normal."""
        face = int(np.searchsorted(self._upto, rng.random()))
        u, v = rng.random(2)
        if u + v > 1:
            u, v = 1 - u, 1 - v
        a, b, c = self.triangles[face]
        return a + u * (b - a) + v * (c - a), self._normals[face]

    def heights(
        self, origin: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], at: Float[np.ndarray, "p 2"]
    ) -> Float[np.ndarray, " p"]:
        """How high the object stands above each place of a plane, seen from far outside along -z; -inf where not.

        Args:
            origin: of the plane, in mm.
            frame: its x, y and z axes as columns.
            at: places in the plane, in mm.
        """
        start = origin + at @ frame[:, :2].T + frame[:, 2] * self.reach
        down = np.broadcast_to(-frame[:, 2], start.shape)
        faces = self._scene.run(start.astype(np.float32), down.astype(np.float32))
        height = np.full(len(at), -np.inf)
        hit = np.flatnonzero(faces >= 0)
        normals = self._normals[faces[hit]]
        # Embree is float32; the hit triangle's plane gives the distance in full precision.
        steep = np.einsum("ij,j->i", normals, -frame[:, 2])
        away = np.einsum("ij,ij->i", self.triangles[faces[hit], 0] - start[hit], normals)
        good = np.abs(steep) > 1e-4  # a wall seen edge-on has no height
        height[hit[good]] = self.reach - away[good] / steep[good]
        return height
