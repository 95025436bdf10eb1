"""The surface of a solid as a mesh that is sound, in one piece, and the same on every machine."""

import numpy as np
import trimesh
from jaxtyping import Int
from manifold3d import Manifold

GRID = 1e-5
"""Vertices are rounded to this, in mm: the last bits of sines differ between machines."""

SLIVER = 2e-3
"""Edges shorter than this, in mm, are collapsed: they are left over where cuts almost meet."""

FLATTEST = 1e-9
"""The smallest face that an object may have, in mm²: a rounding error of the grid is about as large."""


def surface_of(solid: Manifold) -> trimesh.Trimesh | None:
    """The solid's surface; None unless it is sound and one piece.

    Crumbs that a cut leaves behind are dropped, since no workshop delivers them.
    """
    pieces = sorted(solid.decompose(), key=lambda piece: -piece.volume())
    if not pieces or pieces[0].volume() < 0.97 * solid.volume():
        return None
    surface = pieces[0].simplify(SLIVER).to_mesh64()
    vertices, corners = np.unique(
        np.round(np.asarray(surface.vert_properties)[:, :3] / GRID), axis=0, return_inverse=True
    )
    faces = without_folds(corners.reshape(-1)[np.asarray(surface.tri_verts, np.int64)])
    mesh = trimesh.Trimesh(vertices * GRID, faces, process=False)
    return mesh if is_sound(mesh) else None


def is_sound(mesh: trimesh.Trimesh) -> bool:
    """One watertight body with outward normals, without flat faces."""
    closed = mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    return bool(closed and mesh.body_count == 1 and mesh.area_faces.min() > FLATTEST)


def without_folds(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "g 3"]:
    """Without what rounding flattened: faces of two equal corners, and pairs of faces back to back."""
    first = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    weights = (faces.max() + 1) ** np.arange(3)
    return faces[~np.isin(faces @ weights, faces[:, [0, 2, 1]] @ weights)]
