"""Clouds as files: PLY, PCD, text, CSV, NumPy's, LAS, and meshes' vertices. Coordinates are doubles."""

import textwrap
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import arrays, las, mesh, pcd, ply, ply_writing, text
from pcsr.clouds.formats.beginnings import check_start
from pcsr.errors import UserError
from pcsr.files import check_target, write_whole
from pcsr.geometry.checks import check_cloud
from pcsr.inputs import HEAD, Readable, read_bytes, read_pipe
from pcsr.limits import LARGEST_PIPE

T = TypeVar("T")

CLOUD_READERS: dict[str, Callable[[bytes], Cloud]] = {
    ".ply": ply.read,
    ".pcd": pcd.read,
    ".xyz": text.read_xyz,
    ".txt": text.read_xyz,
    ".csv": text.read_csv,
    ".npy": arrays.read_npy,
    ".npz": arrays.read_npz,
    ".obj": mesh.read_obj,
    ".off": mesh.read_off,
    ".stl": mesh.read_stl,
    ".glb": mesh.read_glb,
    ".las": las.read,
    ".laz": las.read,
}
CLOUD_WRITERS: dict[str, Callable[[Cloud], bytes]] = {
    ".ply": ply_writing.write,
    ".pcd": pcd.write,
    ".xyz": text.write_xyz,
    ".txt": text.write_xyz,
    ".csv": text.write_csv,
    ".npy": arrays.write_npy,
    ".npz": arrays.write_npz,
    ".obj": mesh.write_obj,
    ".las": las.write_las,
    ".laz": las.write_laz,
}
MEMORY = {
    ".xyz": 11.0,
    ".txt": 11.0,
    ".csv": 11.0,
    ".obj": 8.0,
    ".off": 8.0,
    ".glb": 6.0,
    ".stl": 11.0,
    ".laz": 14.0,
}
"""What reading a file takes at its peak, in sizes of the file: measured on a million points."""
LONGEST = 500
"""The longest reason in a message, in characters."""
LEAST_MEMORY = 3.0
"""The same for all other kinds."""


def _points_of(read: Callable[[bytes], Cloud]) -> Callable[[bytes], np.ndarray]:
    return lambda data: read(data).points


READERS: dict[str, Callable[[bytes], np.ndarray]] = {
    suffix: _points_of(CLOUD_READERS[suffix]) for suffix in (".ply", ".pcd", ".npy", ".npz")
} | {".xyz": text.xyz_points, ".txt": text.xyz_points, ".csv": text.csv_points}
WRITERS = {suffix: CLOUD_WRITERS[suffix] for suffix in READERS}


def read_cloud(path: Path, suffix: str | None = None, *, bad: Literal["refuse", "drop"] = "refuse") -> Cloud:
    """A whole cloud from a file, by its suffix: points, colours, normals and every other column.

    Of a mesh, the vertices. In the file's own frame and unit.

    Args:
        path: the file.
        suffix: of which kind it is, ".ply" for one; by default its own.
        bad: what to do with rows whose coordinates are not finite: refuse the file, or leave them out and
            put their number into `about["dropped"]`.

    Raises:
        UserError: no such file, an unknown suffix or one of another kind, a file that is damaged or holds no
            points, or points that are not finite.
    """
    suffix = suffix or path.suffix
    _by_suffix(suffix, CLOUD_READERS, str(path))
    return read_cloud_bytes(_content(path, suffix), suffix, str(path), bad=bad)


def read_cloud_pipe(
    file: Readable, suffix: str, name: str, *, bad: Literal["refuse", "drop"] = "refuse", most: int = LARGEST_PIPE
) -> Cloud:
    """What `read_cloud` reads, from a pipe: all of it, up to its end.

    Args:
        file: the pipe.
        suffix: of which kind its content is: ".ply".
        name: what messages call it.
        bad: as in `read_cloud`.
        most: bytes that are read at most.

    Raises:
        UserError: as `read_cloud`, or the pipe does not end.
    """
    _by_suffix(suffix, CLOUD_READERS, name)
    data = read_pipe(
        file, name, most=most, memory=_memory(suffix), check=partial(check_start, suffix=suffix, name=name)
    )
    return read_cloud_bytes(data, suffix, name, bad=bad)


def read_cloud_bytes(data: bytes, suffix: str, name: str, *, bad: Literal["refuse", "drop"] = "refuse") -> Cloud:
    """What `read_cloud` reads, from memory: what came through a pipe, say.

    Args:
        data: the content of a file.
        suffix: of which kind it is: ".ply".
        name: what messages call it.
        bad: as in `read_cloud`.

    Raises:
        UserError: as `read_cloud`.
    """
    cloud = _decoded(data, suffix, name, CLOUD_READERS)
    if not len(cloud):
        raise UserError(f"{name} holds no points")
    if bad == "drop":
        finite = np.isfinite(cloud.points).all(axis=1)
        dropped = len(cloud) - int(finite.sum())
        if dropped == len(cloud):
            raise UserError(f"{name}: none of its {dropped} points has coordinates that are all finite")
        cloud = cloud.chosen(finite) if dropped else cloud
        return replace(cloud, about={**cloud.about, "dropped": dropped})
    _checked(cloud.points, name, ", or have them dropped: --bad drop, or bad='drop' in Python")
    return cloud


def writable(path: Path) -> None:
    """Check that clouds can be written by the suffix of `path`, before the work that makes one.

    Raises:
        UserError: they can't: the suffix is unknown or only read, a library is missing, or the path is that of a
            folder, a device, a pipe or a socket.
    """
    check_target(path)
    _by_suffix(path.suffix, CLOUD_WRITERS, str(path))
    if path.suffix.lower() in (".las", ".laz"):
        las.check_installed(compressed=path.suffix.lower() == ".laz")
    if path.suffix.lower() == ".pcd":
        pcd.check_installed()


def write_cloud(path: Path, cloud: Cloud) -> None:
    """Write a cloud by the suffix of `path`, whole or not at all.

    What the format can't hold takes the nearest type that it has; where that would lose numbers it is refused.
    Text and .npy have one kind of number or two, and .npy no names.

    Raises:
        UserError: a suffix that cannot be written, no points, or coordinates that are not finite.
        RunError: the file cannot be written.
    """
    data = _encoded(cloud, path.suffix, str(path))
    write_whole(path, lambda part: _write_bytes(part, data))


def cloud_bytes(cloud: Cloud, suffix: str) -> bytes:
    """What `write_cloud` writes, in memory; `suffix` is the kind of file: ".ply".

    Raises:
        UserError: as `write_cloud`.
    """
    return _encoded(cloud, suffix, f"the {suffix} cloud")


def read_points(path: Path) -> Float[np.ndarray, "n 3"]:
    """The points of a file, by its suffix; of a mesh, its vertices. In the file's own frame and unit.

    Text has three numbers or more on a line, parted by white space or commas; lines that start with # or //
    are comments. A first line of names is allowed, and where x, y and z are among them they are what is read.

    Raises:
        UserError: no such file, an unknown suffix, a file that is damaged or holds no points, or points that
            are not finite.
    """
    _by_suffix(path.suffix, READERS, str(path))
    return _checked(_decoded(_content(path, path.suffix), path.suffix, str(path), READERS), str(path))


def write_points(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points by the suffix of `path`, whole or not at all; reading gives the same doubles.

    Raises:
        UserError: an unknown suffix, no points, or points that are not finite.
        RunError: the file cannot be written.
    """
    encode = _by_suffix(path.suffix, WRITERS, str(path))
    data = encode(Cloud(np.ascontiguousarray(_checked(np.asarray(points, np.float64), str(path)))))
    write_whole(path, lambda part: _write_bytes(part, data))


def _write_bytes(part: Path, data: bytes) -> None:
    part.write_bytes(data)


def _content(path: Path, suffix: str) -> bytes:
    check = partial(check_start, suffix=suffix, name=str(path))
    return read_bytes(path, memory=_memory(suffix), check=check)


def _memory(suffix: str) -> float:
    return MEMORY.get(suffix.lower(), LEAST_MEMORY)


def _by_suffix(suffix: str, known: Mapping[str, T], name: str) -> T:
    suffix = suffix.lower()
    if suffix not in known:
        verb = "can be written" if suffix in CLOUD_READERS and known is CLOUD_WRITERS else "are known"
        raise UserError(f"{name}: no cloud format '{suffix}': {', '.join(sorted(known))} {verb}")
    return known[suffix]


def _decoded(data: bytes, suffix: str, name: str, readers: Mapping[str, Callable[[bytes], T]]) -> T:
    read = _by_suffix(suffix, readers, name)
    suffix = suffix.lower()
    check_start(data[:HEAD], suffix, name)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what no double holds is not finite: looked at later
            return read(data)
    except UserError as error:
        reason = str(error)  # with names and numbers of the file, however long they are
        raise UserError(f"{name}: {reason if len(reason) <= LONGEST else reason[:LONGEST] + '…'}") from error
    except Exception as error:  # the readers raise whatever a malformed file makes them trip over
        reason = "it needs more memory than is free" if isinstance(error, MemoryError) else str(error)
        reason = textwrap.shorten(reason, 200) or type(error).__name__
        raise UserError(f"{name} cannot be read as a {suffix} file: {reason}") from error


def _encoded(cloud: Cloud, suffix: str, name: str) -> bytes:
    encode = _by_suffix(suffix, CLOUD_WRITERS, name)
    _checked(cloud.points, name)
    try:
        return encode(cloud)
    except UserError as error:
        raise UserError(f"{name}: {error}") from error


def _checked(points: np.ndarray, name: str, remedy: str = "") -> Float[np.ndarray, "n 3"]:
    if points.size and (points.ndim != 2 or points.shape[1] < 3):
        raise UserError(f"{name} holds an array of shape {points.shape}: points are (n, 3)")
    points = points[:, :3] if points.size else np.zeros((0, 3))
    check_cloud(points, name, remedy=remedy)
    return points
