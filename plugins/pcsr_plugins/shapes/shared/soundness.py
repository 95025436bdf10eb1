"""What a mesh must be before points are sampled on it and a gel is pressed into it."""

import numpy as np
import trimesh

from pcsr import UserError

THINNEST = 1e-12
"""Area over the squared diagonal below which a surface is a line or a point, rounding aside."""


def check_mesh(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """The mesh itself, if points can be sampled on it.

    Holes and several bodies are fine: scans have them.

    Args:
        mesh: triangles in any unit.
        name: what a message calls it: a part's name, or a file's path.

    Raises:
        UserError: no faces, a face that is not a triangle of its vertices, coordinates that are not finite,
            or no area.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if not len(faces):
        raise UserError(f"{name} has no faces: a mesh of triangles is needed, not a cloud of points or curves")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise UserError(f"{name} has faces of shape {faces.shape}: triangulate it")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise UserError(f"{name} has a face whose corner is not among its {len(vertices)} vertices: repair it")
    corners = vertices[faces]
    if not np.isfinite(corners).all():
        raise UserError(f"{name} has a coordinate that is not finite: repair or re-export it")
    span = np.ptp(corners, axis=(0, 1))
    if mesh.area <= THINNEST * float(span @ span):
        raise UserError(f"{name} has no area: all of its {len(faces)} faces are lines or points")
    return mesh
