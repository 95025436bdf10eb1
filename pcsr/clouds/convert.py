"""Conversion of the clouds of numpy, torch, trimesh and Open3D to `Cloud` and back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.errors import UserError
from pcsr.limits import check_memory

MEMORY = 100
"""Least memory that each point of a cloud needs, in bytes."""


@dataclass(frozen=True)
class CloudAdapter:
    """Cloud converted from another library, with the function that converts back."""

    cloud: Cloud
    """Converted cloud, with colours and normals."""
    restore: Callable[[Cloud], Any]
    """Function that converts a cloud to the original type."""


def convert(cloud: Any) -> CloudAdapter:
    """Convert a cloud of any supported type to a `Cloud`.

    Raises:
        UserError: the type is not supported, the shape is not (n, 3), or the cloud does not fit into memory.
    """
    if isinstance(cloud, Cloud):
        return CloudAdapter(cloud, lambda dense: dense)
    module = type(cloud).__module__.partition(".")[0]
    if module == "torch":
        return _torch(cloud)
    if module == "trimesh" and not isinstance(cloud, np.ndarray):  # not for its vertices, a subclass of arrays
        return _trimesh(cloud)
    if module == "open3d":
        return _open3d(cloud)
    if isinstance(cloud, np.ma.MaskedArray) and np.ma.getmaskarray(cloud).any():
        raise UserError("some of the cloud's coordinates are masked: leave these points out, and give a plain array")
    try:
        array = np.asarray(cloud)
        if array.dtype.kind not in "iuf" and not isinstance(cloud, np.ndarray):
            raise ValueError(array.dtype)
    except (TypeError, ValueError, RuntimeError) as error:
        raise UserError(
            f"a {type(cloud).__name__} is no cloud: give an array or tensor (n, 3), a trimesh or an Open3D cloud"
        ) from error
    kind = array.dtype if array.dtype.kind == "f" else np.dtype(np.float64)
    return CloudAdapter(Cloud(_doubles(array)), lambda dense: dense.points.astype(kind, copy=False))


def _check(shape: tuple[int, ...], real: bool, kind: object) -> None:
    """Check the shape and type of a cloud before it is converted.

    Raises:
        UserError: the shape is not (n, 3), the numbers are not real, or the cloud does not fit into memory.
    """
    if len(shape) != 2 or shape[1] != 3:
        hint = ": transpose it" if len(shape) == 2 and shape[0] == 3 else ": one row for each point"
        hint = ": take its first three columns, [:, :3]" if len(shape) == 2 and shape[1] > 3 and shape[0] != 3 else hint
        raise UserError(f"a cloud has the shape (n, 3), got {tuple(shape)}{hint}")
    if not real:
        raise UserError(f"a cloud's coordinates are real numbers, got {kind}")
    check_memory(MEMORY * shape[0], f"a cloud of {shape[0]} points")


def _doubles(array: np.ndarray) -> Float[np.ndarray, "n 3"]:
    _check(array.shape, array.dtype.kind in "iuf", array.dtype)
    with np.errstate(over="ignore"):  # numbers beyond doubles become infinite and are refused later
        return array.astype(np.float64)


def _torch(cloud: Any) -> CloudAdapter:
    import torch

    if not hasattr(cloud, "detach"):
        raise UserError(f"a torch {type(cloud).__name__} is no cloud: give a tensor (n, 3)")
    _check(cloud.shape, not cloud.is_complex() and cloud.dtype != torch.bool, cloud.dtype)
    try:
        points = cloud.detach().cpu().double().numpy()
    except (RuntimeError, NotImplementedError, TypeError) as error:  # sparse, quantized, or on the device 'meta'
        raise UserError(f"a tensor of layout {cloud.layout} on {cloud.device} has no coordinates to read") from error
    kind = cloud.dtype if cloud.is_floating_point() else torch.float64
    return CloudAdapter(Cloud(points), lambda dense: torch.from_numpy(dense.points).to(cloud.device, kind))


def _trimesh(cloud: Any) -> CloudAdapter:
    import trimesh

    if not hasattr(cloud, "vertices"):
        raise UserError(f"a trimesh {type(cloud).__name__} has no vertices: give a PointCloud or a Trimesh")
    points = _doubles(np.asarray(cloud.vertices))
    colours = np.asarray(cloud.visual.vertex_colors) if hasattr(cloud, "visual") else np.zeros(0)
    columns = {"colour": colours} if colours.shape[:1] == points.shape[:1] else {}

    def restore(dense: Cloud) -> Any:
        return trimesh.PointCloud(dense.points, colors=dense.columns.get("colour"))  # type: ignore[no-untyped-call]

    return CloudAdapter(Cloud(points, columns), restore)


def _open3d(cloud: Any) -> CloudAdapter:
    columns = {name: np.asarray(getattr(cloud, name)) for name in ("colors", "normals") if len(getattr(cloud, name))}

    def restore(dense: Cloud) -> Any:
        import open3d

        dense_cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(dense.points))
        for name, column in dense.columns.items():
            setattr(dense_cloud, name, open3d.utility.Vector3dVector(column))
        return dense_cloud

    return CloudAdapter(Cloud(_doubles(np.asarray(cloud.points)), columns), restore)
