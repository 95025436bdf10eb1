"""Surface reconstruction from a dense cloud by Open3D (extra `[open3d]`)."""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.errors import RunError, UserError
from pcsr.extras import imported
from pcsr.files import write_whole

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb")
"""Suffixes of the mesh formats that can be written."""
NEIGHBOURS = 16
"""Points from which a normal is estimated."""
DEPTH = 9
"""Depth of the octree: 512 cells along the cloud's longest side."""
FAR = 3.0
"""The surface is cut off at a distance of `FAR` × mean spacing from the points: Poisson reconstruction closes every
hole."""


def open3d() -> ModuleType:
    """Import Open3D.

    Raises:
        UserError: Open3D or a system library that it needs is not installed.
    """
    module: ModuleType = imported("open3d", "a surface")
    return module


def write_surface(path: Path, cloud: Cloud) -> int:
    """Reconstruct a surface from a cloud (Kazhdan and Hoppe, 2013) and write it as a triangle mesh.

    Normals are taken from the cloud, or estimated if it has none. The surface is cut off away from the points.

    Args:
        path: the file: .ply, .obj, .stl, .off or .glb.
        cloud: dense cloud in any frame and unit.

    Returns:
        The number of triangles.

    Raises:
        UserError: the suffix is unknown, or Open3D is not installed.
        RunError: no surface was found, or the file cannot be written.
    """
    check_suffix(path)
    o3d = open3d()
    centre = cloud.points.mean(0)  # Open3D computes in single precision
    points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points - centre))
    if all(name in cloud.columns for name in ("nx", "ny", "nz")):
        normals = np.stack([cloud.columns[name] for name in ("nx", "ny", "nz")], axis=1).astype(np.float64)
        points.normals = o3d.utility.Vector3dVector(normals)
    else:
        points.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
        try:
            points.orient_normals_consistent_tangent_plane(NEIGHBOURS)
        except RuntimeError:  # its triangulation fails where many points lie on one sphere or plane
            points.normals = o3d.utility.Vector3dVector(
                _outwards(np.asarray(points.points), np.asarray(points.normals))
            )
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(points, depth=DEPTH, n_threads=1)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    kept = faces[_close_to_points(vertices, cloud.points - centre)[faces].all(1)]
    if not len(kept):
        raise RunError(f"{path}: no surface was found through the {len(cloud)} points")
    _export(path, vertices + centre, kept)
    return len(kept)


def check_suffix(path: Path) -> None:
    """Check that a mesh can be written to a path.

    Raises:
        UserError: the suffix is no known mesh format.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: no mesh format '{path.suffix}': {', '.join(SUFFIXES)} are known")


def _outwards(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Orient normals away from the centroid of the cloud, which is right for convex shapes."""
    inwards = np.einsum("ij,ij->i", points - points.mean(0), normals) < 0
    return np.where(inwards[:, None], -normals, normals)


def _close_to_points(vertices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return a mask of the vertices within `FAR` × mean spacing of a point."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    mean_spacing = tree.query(points[:: max(1, len(points) // 10_000)], k=7)[0][:, 1:].mean()
    return np.asarray(tree.query(vertices)[0] <= FAR * mean_spacing)


def _export(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.remove_unreferenced_vertices()
    kind = path.suffix.lower().lstrip(".")

    def write(part: Path) -> None:
        data: Any = mesh.export(file_type=kind)
        part.write_bytes(data.encode() if isinstance(data, str) else data)

    write_whole(path, write)
