"""Reading and writing of cloud files, whose formats `format_table` lists; of meshes the vertices are read."""

import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import las, pcd
from pcsr.clouds.formats.beginnings import check_start
from pcsr.clouds.formats.format_table import (
    CLOUD_READERS,
    CLOUD_WRITERS,
    NAMED_READERS,
    format_of,
    memory,
    reader,
    writer,
)
from pcsr.errors import PcsrWarning, RunError, UserError
from pcsr.files import check_target, write_whole
from pcsr.geometry.checks import check_cloud
from pcsr.inputs import HEAD, Readable, read_bytes, read_pipe
from pcsr.limits import LARGEST_PIPE

__all__ = [
    "CLOUD_READERS",
    "CLOUD_WRITERS",
    "NAMED_READERS",
    "cloud_bytes",
    "read_cloud",
    "read_cloud_bytes",
    "read_cloud_pipe",
    "read_points",
    "writable",
    "write_cloud",
    "write_points",
]
LONGEST = 500
"""Longest reason in a message, in characters."""


def read_cloud(path: Path, suffix: str | None = None, *, bad: Literal["refuse", "drop"] = "refuse") -> Cloud:
    """Read a cloud with all of its columns from a file; of a mesh, the vertices. The suffix sets the format.

    Args:
        path: path of the file.
        suffix: suffix or name of the format, such as ".ply" or "kitti"; by default what the path's name tells.
        bad: refuse a file with coordinates that are not finite, or drop these rows and put their number into
            `about["dropped"]`.

    Returns:
        The cloud, in the frame and unit of the file.

    Raises:
        UserError: the file does not exist, has an unknown suffix, is damaged or of another format, holds no points,
            or holds points that are not finite.

    Warns:
        PcsrWarning: the file was read in part, or its meaning was guessed.
    """
    suffix = format_of(path, suffix)
    reader(suffix, str(path))
    check = partial(check_start, suffix=suffix, name=str(path))
    return read_cloud_bytes(read_bytes(path, memory=memory(suffix), check=check), suffix, str(path), bad=bad)


def read_cloud_pipe(
    file: Readable, suffix: str, name: str, *, bad: Literal["refuse", "drop"] = "refuse", most: int = LARGEST_PIPE
) -> Cloud:
    """Read a cloud from a pipe, up to its end.

    Args:
        file: pipe to read.
        suffix: suffix or name of the format, such as ".ply" or "kitti".
        name: name of the pipe, for messages.
        bad: as in `read_cloud`.
        most: largest number of bytes to read.

    Raises:
        UserError: as `read_cloud`, or the pipe has more than `most` bytes.
    """
    suffix = format_of(Path(), suffix)
    reader(suffix, name)
    data = read_pipe(file, name, most=most, memory=memory(suffix), check=partial(check_start, suffix=suffix, name=name))
    return read_cloud_bytes(data, suffix, name, bad=bad)


def read_cloud_bytes(data: bytes, suffix: str, name: str, *, bad: Literal["refuse", "drop"] = "refuse") -> Cloud:
    """Read a cloud from the bytes of a file.

    Args:
        data: content of the file.
        suffix: suffix or name of the format, such as ".ply" or "kitti".
        name: name of the file, for messages.
        bad: as in `read_cloud`.

    Raises:
        UserError: as `read_cloud`.

    Warns:
        PcsrWarning: the file was read in part, or its meaning was guessed.
    """
    cloud = _decoded(data, format_of(Path(), suffix), name)
    if not len(cloud):
        raise UserError(f"{name} holds no points")
    for note in cloud.about.get("notes", ()):
        warnings.warn(f"{name}: {note}", PcsrWarning, stacklevel=3)
    if bad == "drop":
        finite = np.isfinite(cloud.points).all(axis=1)
        dropped = len(cloud) - int(finite.sum())
        if dropped == len(cloud):
            raise UserError(f"{name}: none of its {dropped} points has coordinates that are all finite")
        cloud = cloud.chosen(finite) if dropped else cloud
        return replace(cloud, about={**cloud.about, "dropped": dropped})
    _checked(cloud.points, name, ", or have them dropped: --bad drop")
    return cloud


def writable(path: Path, cloud: Cloud | None = None) -> None:
    """Check that a cloud can be written to a path, before it is computed.

    Args:
        path: path of the file to write.
        cloud: cloud with the columns that are to be written, such as the sparse one. It is encoded on trial.

    Raises:
        UserError: the suffix is unknown or can only be read, a library is missing, the path is a folder, a device, a
            pipe or a socket, or the format cannot hold the columns of `cloud`.
    """
    check_target(path)
    writer(path.suffix, str(path))
    if path.name.lower().endswith(".copc.laz"):
        raise UserError(f"{path}: COPC cannot be written: name a plain LAZ file, {path.name[: -len('.copc.laz')]}.laz")
    if path.suffix.lower() in (".las", ".laz"):
        las.check_installed(compressed=path.suffix.lower() == ".laz")
    if path.suffix.lower() == ".pcd":
        pcd.check_installed()
    if cloud is not None:
        _encoded(cloud, path.suffix, str(path))


def write_cloud(path: Path, cloud: Cloud) -> None:
    """Write a cloud to a file, completely or not at all. The suffix of `path` sets the format.

    Types of columns that the format lacks are converted to the closest type; a column that would lose precision is
    refused. Text and `.npy` have one or two types of numbers, and `.npy` has no names of columns.

    Raises:
        UserError: the suffix cannot be written, there are no points, a column does not fit the format, or a coordinate
            is not finite.
        RunError: the file cannot be written.
    """
    data = _encoded(cloud, path.suffix, str(path))
    write_whole(path, lambda part: _write_bytes(part, data))


def cloud_bytes(cloud: Cloud, suffix: str) -> bytes:
    """Return the bytes of a cloud file; `suffix` sets the format, such as ".ply".

    Raises:
        UserError: as `write_cloud`.
    """
    return _encoded(cloud, suffix, f"the {suffix} cloud")


def read_points(path: Path, suffix: str | None = None) -> Float[np.ndarray, "n 3"]:
    """Read the points of a file without its columns, in its frame and unit; see `read_cloud`.

    Args:
        path: path of the file.
        suffix: suffix or name of the format; by default what the path's name tells.

    Raises:
        UserError: as `read_cloud`.
    """
    return read_cloud(path, suffix).points


def write_points(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points to a file, completely or not at all. Reading the file returns the same doubles, but for LAS and LAZ.

    Raises:
        UserError: the suffix is unknown, there are no points, or points are not finite.
        RunError: the file cannot be written.
    """
    writer(path.suffix, str(path))
    write_cloud(path, Cloud(np.ascontiguousarray(_checked(np.asarray(points, np.float64), str(path)))))


def _write_bytes(part: Path, data: bytes) -> None:
    part.write_bytes(data)


def _decoded(data: bytes, suffix: str, name: str) -> Cloud:
    read = reader(suffix, name)
    check_start(data[:HEAD], suffix, name)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond doubles are found later, as not finite
            return read(data)
    except UserError as error:
        reason = str(error).encode("utf-8", "replace").decode()  # may quote long or broken text of the file
        raise UserError(f"{name}: {reason if len(reason) <= LONGEST else reason[:LONGEST] + '…'}") from error
    except MemoryError as error:
        raise UserError(f"{name} cannot be read: it needs more memory than is free") from error
    except Exception as error:  # malformed files make libraries raise errors of any type, in their words
        raise UserError(
            f"{name} cannot be read as a {suffix} file: it is damaged, or of another format: get the file again, or "
            f"save it anew"
        ) from error


def _encoded(cloud: Cloud, suffix: str, name: str) -> bytes:
    encode = writer(suffix, name)
    _checked(cloud.points, name)
    try:
        return encode(cloud)
    except UserError as error:
        raise UserError(f"{name}: {error}") from error
    except MemoryError as error:
        raise RunError(f"{name} cannot be written: it needs more memory than is free") from error
    except Exception as error:  # libraries raise errors of any type, in their words
        raise UserError(f"{name}: a {suffix} file cannot hold this cloud: write a .ply or .npz file") from error


def _checked(points: np.ndarray, name: str, remedy: str = "") -> Float[np.ndarray, "n 3"]:
    if points.size and (points.ndim != 2 or points.shape[1] < 3):
        raise UserError(f"{name} holds an array of shape {points.shape}: points have shape (n, 3)")
    points = points[:, :3] if points.size else np.zeros((0, 3))
    check_cloud(points, name, remedy=remedy)
    return points
