"""Reader of mesh files."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pcsr.clouds.formats.beginnings import check_start
from pcsr.clouds.formats.mesh import MEMORY, MESHES, load_scene
from pcsr.clouds.formats.mesh_checks import check_mesh, fault
from pcsr.errors import UserError
from pcsr.inputs import read_bytes

if TYPE_CHECKING:
    from trimesh import Trimesh


def read_mesh(path: str | Path) -> "Trimesh":
    """Read a mesh from a file. The meshes of a scene are joined into one.

    Vertices and faces are those of the file: none are merged or dropped. Colours and textures are not read.

    Args:
        path: path of a `.ply`, `.obj`, `.stl`, `.off` or `.glb` file.

    Returns:
        The mesh, in the frame and unit of the file.

    Raises:
        UserError: the file cannot be read or is too large, the mesh has no faces, or a face refers to a vertex that
            does not exist.

    Examples:
        >>> import trimesh
        >>> _ = trimesh.creation.box().export("box.stl")
        >>> len(pcsr.read_mesh("box.stl").faces)
        12
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESHES:
        raise UserError(f"{path}: no mesh format '{suffix}': {', '.join(MESHES)} are known")
    data = read_bytes(path, memory=MEMORY, check=lambda head: check_start(head, suffix, str(path)))
    try:
        with np.errstate(all="ignore"):  # of trimesh; vertices that are not finite are found when they are used
            check_mesh(data, suffix)
            mesh = _joined(load_scene(data, suffix[1:]))
    except UserError as error:
        raise UserError(f"{path}: {error}") from error
    except MemoryError as error:
        raise UserError(f"{path} cannot be read: it needs more memory than is free") from error
    except Exception as error:  # malformed files make the readers raise errors of any type
        raise UserError(f"{path} cannot be read as a mesh: {fault(data, suffix)}") from error
    if not len(mesh.faces):
        raise UserError(f"{path} has no faces: give a mesh, not a cloud")
    check_faces(np.asarray(mesh.faces), len(mesh.vertices), str(path))
    return mesh


def _joined(scene: Any) -> "Trimesh":
    import trimesh

    for part in scene.geometry.values():
        part.visual = trimesh.visual.ColorVisuals()  # textures would split vertices and need an image library
    mesh: Trimesh = scene.to_mesh()
    return mesh


def check_faces(faces: np.ndarray, count: int, name: str) -> None:
    """Check that faces refer to existing vertices.

    Args:
        faces: (f, 3), indices of vertices.
        count: number of vertices.
        name: name of the mesh, for messages.

    Raises:
        UserError: a face refers to a vertex that does not exist.
    """
    bad = np.flatnonzero(((faces < 0) | (faces >= count)).any(axis=1))
    if len(bad):
        raise UserError(
            f"{name}: {len(bad)} of its {len(faces)} faces name vertices that are not there, such as face {bad[0]}, "
            f"{faces[bad[0]].tolist()}: it has {count} vertices, counted from 0"
        )
