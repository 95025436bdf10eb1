"""Clouds as other libraries hold them: numpy, torch, trimesh and Open3D, there and back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.carry import carry
from pcsr.errors import UserError
from pcsr.limits import check_memory

MEMORY = 100
"""Bytes that a point takes at least, in all that is made of it."""


@dataclass(frozen=True)
class Converted:
    """The points of somebody's cloud."""

    points: Float[np.ndarray, "n 3"]
    """Doubles."""
    back: Callable[[Float[np.ndarray, "new 3"], bool], Any]
    """New points, with the old ones before them if told so, to a cloud of the kind that came in."""


def convert(cloud: Any) -> Converted:
    """The points of a cloud of any known kind.

    Raises:
        UserError: it is of no known kind, or not of shape (n, 3).
    """
    module = type(cloud).__module__.partition(".")[0]
    if module == "torch":
        return _torch(cloud)
    if module == "trimesh" and not isinstance(cloud, np.ndarray):  # its vertices are an array of its own kind
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
    points = _doubles(array)
    kind = array.dtype if array.dtype.kind == "f" else np.dtype(np.float64)

    def back(new: Float[np.ndarray, "new 3"], keep: bool) -> Any:
        return np.concatenate([array, new]).astype(kind) if keep else new.astype(kind)

    return Converted(points, back)


def _check(shape: tuple[int, ...], real: bool, kind: object) -> None:
    """Refuse what is no cloud by its shape and type, before it is converted.

    Raises:
        UserError: another shape, other numbers than real ones, or more than fit into memory.
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
    with np.errstate(over="ignore"):  # what no double holds is infinite, and that is refused
        return array.astype(np.float64)


def _torch(cloud: Any) -> Converted:
    import torch

    def back(new: Float[np.ndarray, "new 3"], keep: bool) -> Any:
        kind = cloud.dtype if cloud.is_floating_point() else torch.float64
        made = torch.from_numpy(new).to(cloud.device, kind)
        return torch.cat([cloud.detach().to(kind), made]) if keep else made

    if not hasattr(cloud, "detach"):
        raise UserError(f"a torch {type(cloud).__name__} is no cloud: give a tensor (n, 3)")
    _check(cloud.shape, not cloud.is_complex() and cloud.dtype != torch.bool, cloud.dtype)
    try:
        points = cloud.detach().cpu().double().numpy()
    except (RuntimeError, NotImplementedError, TypeError) as error:  # sparse, quantized, or on the device 'meta'
        raise UserError(f"a tensor of layout {cloud.layout} on {cloud.device} has no coordinates to read") from error
    return Converted(points, back)


def _trimesh(cloud: Any) -> Converted:
    import trimesh

    if not hasattr(cloud, "vertices"):
        raise UserError(f"a trimesh {type(cloud).__name__} has no vertices: give a PointCloud or a Trimesh")
    points = _doubles(np.asarray(cloud.vertices))
    colours = np.asarray(cloud.visual.vertex_colors) if hasattr(cloud, "visual") else np.zeros(0)

    def back(new: Float[np.ndarray, "new 3"], keep: bool) -> Any:
        columns = {}
        if colours.shape[:1] == points.shape[:1]:
            columns = carry({"colour": colours}, points, new)
        told = columns.get("colour")
        if keep:
            told = None if told is None else np.concatenate([colours, told])
            new = np.concatenate([points, new])
        return trimesh.PointCloud(new, colors=told)  # type: ignore[no-untyped-call]

    return Converted(points, back)


def _open3d(cloud: Any) -> Converted:
    points = _doubles(np.asarray(cloud.points))
    columns = {name: np.asarray(getattr(cloud, name)) for name in ("colors", "normals") if len(getattr(cloud, name))}

    def back(new: Float[np.ndarray, "new 3"], keep: bool) -> Any:
        import open3d

        told = carry(columns, points, new)
        if keep:
            told = {name: np.concatenate([columns[name], told[name]]) for name in columns}
            new = np.concatenate([points, new])
        made = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(new))
        for name, column in told.items():
            setattr(made, name, open3d.utility.Vector3dVector(column))
        return made

    return Converted(points, back)
