"""Ray casting on a mesh in millimetres: Embree finds the triangle, float64 arithmetic the point on it."""

import numpy as np
import trimesh
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.extras import imported
from pcsr.geometry.sampling import face_by_area, point_of_face

EDGE_ON = 0.3
"""A face is nearly edge-on to a ray if the cosine between its normal and the ray is less than this."""
RAYS = "casting rays"
"""Feature that needs embreex, for the message if it is not installed."""


class MeshRays:
    """Mesh for ray casting, in millimetres and centred on the origin.

    Rays hit faces from both sides, so that neither the orientation of the faces nor holes in the mesh matter.

    Args:
        mesh: the mesh in its own frame and unit.
        object_size: length in mm to which the longest side of the bounding box is scaled; None if the mesh is in mm.
        name: name of the mesh in error messages.

    Raises:
        UserError: the mesh has no area, a coordinate is not finite, or the extra `[simulate]` is not installed.
    """

    def __init__(self, mesh: trimesh.Trimesh, object_size: float | None, name: str) -> None:
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        corners = vertices[faces]
        if not len(corners):
            raise UserError(f"{name}: the mesh has no faces, so there is nothing to touch: leave it out")
        if not np.isfinite(corners).all():
            raise UserError(f"{name}: the mesh has a coordinate that is not finite: repair it or leave it out")
        low, high = corners.min((0, 1)), corners.max((0, 1))
        extent = float((high - low).max())
        scale = 1.0 if object_size is None or extent == 0 else object_size / extent
        triangles = (corners - (low + high) / 2) * scale
        self.to_object: Float[np.ndarray, "4 4"] = np.diag([1 / scale, 1 / scale, 1 / scale, 1.0])
        """Transform from this frame, in mm, to the mesh's own frame and unit."""
        self.to_object[:3, 3] = (low + high) / 2
        self.unit = scale
        """The mesh's own unit, in mm."""
        self.faces = len(faces)
        """Number of triangles."""
        self.size = extent * scale
        """Longest side of the bounding box, in mm."""
        self.reach = float(np.linalg.norm(high - low)) * scale
        """Length of the bounding box's diagonal, in mm: points farther from the mesh are outside of the box."""

        self._corners = triangles[:, 0].copy()
        self._edges = (triangles[:, 1:] - triangles[:, :1]).transpose(1, 0, 2).copy()
        cross = np.cross(*self._edges)
        double = np.linalg.norm(cross, axis=1)
        if not double.sum() > 0:
            raise UserError(f"{name}: the mesh has no area, so there is nothing to touch: leave it out")
        self._normals = cross / np.where(double > 0, double, 1)[:, None]
        self._cumulated = np.cumsum(double) / double.sum()
        self._scene = imported("embreex.rtcore_scene", RAYS).EmbreeScene()
        # Vertices that belong to no face need not be finite.
        vertices = np.nan_to_num((vertices - (low + high) / 2) * scale, posinf=0.0, neginf=0.0)
        triangle_mesh = imported("embreex.mesh_construction", RAYS).TriangleMesh
        triangle_mesh(self._scene, vertices.astype(np.float32), faces.astype(np.int32))

    def surface_points(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, "count 3"], Float[np.ndarray, "count 3"]]:
        """Draw random points of the surface, uniform by area, in mm, with the unit normals of their faces."""
        faces = face_by_area(self._cumulated, rng.random(count))
        points = point_of_face(self._corners[faces], self._edges[:, faces].transpose(1, 0, 2), rng.random((2, count)).T)
        return points, self._normals[faces]

    def heights(self, points: Float[np.ndarray, "p 3"], axes: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " p"]:
        """Compute the height of the object's surface above each point, along its axis, as seen from far outside.

        Args:
            points: points in mm near the object.
            axes: unit vectors that point away from the object.

        Returns:
            Heights in mm, negative where the surface is below the point; -inf where the ray misses the object.
        """
        return self.reach - self.depths(points + axes * self.reach, -axes)

    def boxes(
        self, origin: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"]
    ) -> tuple[Float[np.ndarray, "f 3"], Float[np.ndarray, "f 3"]]:
        """Compute the bounding box of each triangle in a given frame.

        Args:
            origin: origin of the frame, in mm.
            frame: unit axes as columns.

        Returns:
            Lower and upper bounds in mm.
        """
        first = (self._corners - origin) @ frame
        second, third = (first + edge @ frame for edge in self._edges)
        return np.minimum(np.minimum(first, second), third), np.maximum(np.maximum(first, second), third)

    def depths(self, starts: Float[np.ndarray, "p 3"], directions: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " p"]:
        """Compute the depth of the first hit along each ray, as a multiple of the ray's direction.

        Args:
            starts: start of each ray, in mm.
            directions: direction of each ray, of any length. Directions whose component along an axis is 1 give depths
                along that axis.

        Returns:
            Depths, which are negative by rounding errors at most; inf where the ray misses the object.
        """
        faces = self._scene.run(starts.astype(np.float32), np.ascontiguousarray(directions, np.float32))
        hit = np.flatnonzero(faces >= 0)
        # `take` gathers rows several times as fast as indexing with brackets.
        faces, along = faces.take(hit), directions.take(hit, 0)
        # Embree computes in float32; the plane of the triangle gives the depth in float64.
        corner, normals = self._corners.take(faces, 0) - starts.take(hit, 0), self._normals.take(faces, 0)
        steepness, square = _dot(normals, along), _dot(along, along)
        found = _dot(corner, normals) / np.where(np.abs(steepness) > 1e-12, steepness, 1e-12)
        # On a nearly edge-on face the plane may give a point far off the triangle: its corners bound the depth there.
        edge_on = np.flatnonzero(steepness**2 < EDGE_ON**2 * square)
        faces, along, square = faces[edge_on], along.take(edge_on, 0), square[edge_on]
        a = _dot(corner.take(edge_on, 0), along) / square
        b, c = (a + _dot(edge.take(faces, 0), along) / square for edge in self._edges)
        found[edge_on] = np.clip(found[edge_on], np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c))
        depths = np.full(len(starts), np.inf)
        depths[hit] = found
        return depths


def _dot(a: Float[np.ndarray, "p 3"], b: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " p"]:
    dots: Float[np.ndarray, " p"] = np.einsum("pj,pj->p", a, b)
    return dots
