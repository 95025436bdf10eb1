"""Readers and writers of cloud files: PLY, PCD, text, CSV, PTS, PTX, NumPy, LAS, and meshes, read as vertices."""

import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import Bad
from pcsr.clouds.formats import arrays, las, mesh, pcd, ply, ply_writing, pts, ptx, text
from pcsr.clouds.formats.beginnings import check_start
from pcsr.errors import PcsrWarning, UserError
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
    ".asc": text.read_xyz,
    ".csv": text.read_csv,
    ".pts": pts.read_pts,
    ".ptx": ptx.read_ptx,
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
    ".asc": text.write_xyz,
    ".csv": text.write_csv,
    ".pts": pts.write_pts,
    ".npy": arrays.write_npy,
    ".npz": arrays.write_npz,
    ".obj": mesh.write_obj,
    ".las": las.write_las,
    ".laz": las.write_laz,
}
TEXT_READERS: dict[str, Callable[..., Cloud]] = {
    ".xyz": text.read_xyz,
    ".txt": text.read_xyz,
    ".asc": text.read_xyz,
    ".csv": text.read_csv,
    ".pts": pts.read_pts,
}
"""Readers that take names of columns."""
MEMORY = {
    ".xyz": 11.0,
    ".txt": 11.0,
    ".asc": 11.0,
    ".csv": 11.0,
    ".pts": 11.0,
    ".ptx": 11.0,
    ".obj": 9.0,
    ".off": 8.0,
    ".glb": 6.0,
    ".stl": 11.0,
    ".laz": 14.0,
}
"""Peak memory of reading a file, relative to the size of the file, measured on a million points."""
FINITE_ONLY = (".las", ".laz", ".obj")
"""Formats whose coordinates are finite: those of LAS are integers, and few readers of OBJ take others."""
LONGEST = 500
"""Longest reason in a message, in characters."""
LEAST_MEMORY = 3.0
"""Peak memory of reading a file of a kind that `MEMORY` does not list, relative to the size of the file."""


def _points_of(read: Callable[[bytes], Cloud]) -> Callable[[bytes], np.ndarray]:
    return lambda data: read(data).points


READERS: dict[str, Callable[[bytes], np.ndarray]] = {
    suffix: _points_of(CLOUD_READERS[suffix]) for suffix in (".ply", ".pcd", ".npy", ".npz", ".ptx")
} | {suffix: _points_of(partial(read, all_columns=False)) for suffix, read in TEXT_READERS.items()}
WRITERS = {suffix: CLOUD_WRITERS[suffix] for suffix in READERS if suffix in CLOUD_WRITERS}


def read_cloud(
    path: Path,
    suffix: str | None = None,
    *,
    bad: Bad = "refuse",
    columns: str | Sequence[str] | None = None,
) -> Cloud:
    """Read a cloud with all of its columns from a file; of a mesh, the vertices. The suffix sets the format.

    Args:
        path: path of the file.
        suffix: suffix that sets the format, such as ".ply"; that of the path by default.
        bad: treatment of points that are not finite. "refuse" raises an error; "drop" removes them and puts their
            number into `about["dropped"]`; "keep" leaves them in the cloud. `pcsr.clouds.faults.screen` finds other
            faults.
        columns: names of the columns of a text file, such as "x,y,z,-,red,green,blue", instead of those in the file.
            Columns that are called - or _ and those beyond the last name are left out.

    Returns:
        The cloud, in the frame and unit of the file.

    Raises:
        UserError: the file does not exist, has an unknown suffix, is damaged or of another format, holds no points,
            or holds points that are not finite; or `columns` does not fit the file.

    Warns:
        PcsrWarning: the file was read in part, or its meaning was guessed.
    """
    suffix = suffix or path.suffix
    _by_suffix(suffix, CLOUD_READERS, str(path))
    _check_columns(columns, suffix, str(path))
    return read_cloud_bytes(_content(path, suffix), suffix, str(path), bad=bad, columns=columns)


def read_cloud_pipe(
    file: Readable,
    suffix: str,
    name: str,
    *,
    bad: Bad = "refuse",
    columns: str | Sequence[str] | None = None,
    most: int = LARGEST_PIPE,
) -> Cloud:
    """Read a cloud from a pipe, up to its end.

    Args:
        file: pipe to read.
        suffix: suffix of the format, such as ".ply".
        name: name of the pipe, for messages.
        bad: as in `read_cloud`.
        columns: as in `read_cloud`.
        most: largest number of bytes to read.

    Raises:
        UserError: as `read_cloud`, or the pipe has more than `most` bytes.
    """
    _by_suffix(suffix, CLOUD_READERS, name)
    _check_columns(columns, suffix, name)
    data = read_pipe(
        file, name, most=most, memory=_memory(suffix), check=partial(check_start, suffix=suffix, name=name)
    )
    return read_cloud_bytes(data, suffix, name, bad=bad, columns=columns)


def read_cloud_bytes(
    data: bytes,
    suffix: str,
    name: str,
    *,
    bad: Bad = "refuse",
    columns: str | Sequence[str] | None = None,
) -> Cloud:
    """Read a cloud from the bytes of a file.

    Args:
        data: content of the file.
        suffix: suffix of the format, such as ".ply".
        name: name of the file, for messages.
        bad: as in `read_cloud`.
        columns: as in `read_cloud`.

    Raises:
        UserError: as `read_cloud`.

    Warns:
        PcsrWarning: the file was read in part, or its meaning was guessed.
    """
    _check_columns(columns, suffix, name)
    cloud = _decoded(data, suffix, name, CLOUD_READERS if columns is None else _with_columns(columns))
    if not len(cloud):
        raise UserError(f"{name} holds no points")
    _warn(cloud, name)
    if bad == "drop":
        finite = np.isfinite(cloud.points).all(axis=1)
        dropped = len(cloud) - int(finite.sum())
        if dropped == len(cloud):
            raise UserError(f"{name}: none of its {dropped} points has coordinates that are all finite")
        cloud = cloud.chosen(finite) if dropped else cloud
        return replace(cloud, about={**cloud.about, "dropped": dropped})
    if bad == "refuse":
        _checked(cloud.points, name, ", or have them dropped: --bad drop")
    return cloud


def writable(path: Path) -> None:
    """Check that a cloud can be written to a path, before it is computed.

    Raises:
        UserError: the suffix is unknown or can only be read, a library is missing, or the path is a folder, a device,
            a pipe or a socket.
    """
    check_target(path)
    _by_suffix(path.suffix, CLOUD_WRITERS, str(path))
    if path.suffix.lower() in (".las", ".laz"):
        las.check_installed(compressed=path.suffix.lower() == ".laz")
    if path.suffix.lower() == ".pcd":
        pcd.check_installed()


def check_finite_only(cloud: Cloud, suffix: str, name: str) -> None:
    """Check that points which are not finite are in no cloud whose format cannot hold them.

    Raises:
        UserError: they are.
    """
    suffix = suffix.lower()
    if suffix in FINITE_ONLY and not (finite := np.isfinite(cloud.points).all(axis=1)).all():
        raise UserError(
            f"{name}: {suffix} holds no coordinates that are not finite, and {int((~finite).sum())} points have some: "
            f"drop these points with --bad drop, or write a .ply"
        )


def write_cloud(path: Path, cloud: Cloud, *, bad: Bad = "refuse") -> None:
    """Write a cloud to a file, completely or not at all. The suffix of `path` sets the format.

    Types of columns that the format lacks are converted to the closest type; a column that would lose precision is
    refused. Text and `.npy` have one or two types of numbers, and `.npy` has no names of columns.

    Args:
        path: path of the file.
        cloud: the cloud.
        bad: "keep" writes coordinates that are not finite where the format holds them; otherwise they are an error.

    Raises:
        UserError: the suffix cannot be written, there are no points, a column does not fit the format, or a coordinate
            is not finite.
        RunError: the file cannot be written.
    """
    data = _encoded(cloud, path.suffix, str(path), bad)
    write_whole(path, lambda part: _write_bytes(part, data))


def cloud_bytes(cloud: Cloud, suffix: str, *, bad: Bad = "refuse") -> bytes:
    """Return the bytes of a cloud file; `suffix` sets the format, such as ".ply", and `bad` is as in `write_cloud`.

    Raises:
        UserError: as `write_cloud`.
    """
    return _encoded(cloud, suffix, f"the {suffix} cloud", bad)


def read_points(path: Path, *, columns: str | Sequence[str] | None = None) -> Float[np.ndarray, "n 3"]:
    """Read the points of a file, in its frame and unit. The suffix sets the format.

    Lines of text hold three numbers or more. Lines that start with #, // or % are comments. The first lines may name
    the columns, in a comment too; if x, y and z are among them, these columns are read.

    Args:
        path: path of the file.
        columns: names of the columns of a text file, as in `read_cloud`; other files are read without them.

    Raises:
        UserError: the file does not exist, has an unknown suffix, is damaged, holds no points, or holds points that
            are not finite.

    Warns:
        PcsrWarning: the meaning of a text file was guessed.
    """
    suffix, name = path.suffix.lower(), str(path)
    _by_suffix(suffix, READERS, name)
    data = _content(path, suffix)
    if suffix not in TEXT_READERS:
        return _checked(_decoded(data, suffix, name, READERS), name)
    cloud = _decoded(data, suffix, name, _with_columns(columns, all_columns=False))
    _warn(cloud, name)
    return _checked(cloud.points, name)


def write_points(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points to a file, completely or not at all. Reading the file returns the same doubles.

    Raises:
        UserError: the suffix is unknown, there are no points, or points are not finite.
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


def _warn(cloud: Cloud, name: str) -> None:
    """Warn of what a reader left out or guessed."""
    for note in cloud.about.get("notes", ()):
        warnings.warn(f"{name}: {note}", PcsrWarning, stacklevel=4)


def _with_columns(columns: str | Sequence[str] | None, **options: bool) -> dict[str, Callable[[bytes], Cloud]]:
    """Return the readers of text for given names of columns."""
    return {suffix: partial(read, columns=columns, **options) for suffix, read in TEXT_READERS.items()}


def _check_columns(columns: str | Sequence[str] | None, suffix: str, name: str) -> None:
    if columns is not None and suffix.lower() not in TEXT_READERS:
        raise UserError(
            f"{name} is a {suffix} file, whose columns have names or places of their own: --columns is for "
            f"{', '.join(sorted(TEXT_READERS))}"
        )


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
        with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond doubles are found later, as not finite
            return read(data)
    except UserError as error:
        reason = str(error)  # may quote long names and numbers from the file
        raise UserError(f"{name}: {reason if len(reason) <= LONGEST else reason[:LONGEST] + '…'}") from error
    except Exception as error:  # malformed files make the readers raise errors of any type
        reason = "it needs more memory than is free" if isinstance(error, MemoryError) else str(error)
        reason = textwrap.shorten(reason, 200) or type(error).__name__
        raise UserError(f"{name} cannot be read as a {suffix} file: {reason}") from error


def _encoded(cloud: Cloud, suffix: str, name: str, bad: Bad) -> bytes:
    encode = _by_suffix(suffix, CLOUD_WRITERS, name)
    if bad == "keep" and len(cloud):
        check_finite_only(cloud, suffix, name)
    else:
        _checked(cloud.points, name)
    try:
        return encode(cloud)
    except UserError as error:
        raise UserError(f"{name}: {error}") from error


def _checked(points: np.ndarray, name: str, remedy: str = "") -> Float[np.ndarray, "n 3"]:
    if points.size and (points.ndim != 2 or points.shape[1] < 3):
        raise UserError(f"{name} holds an array of shape {points.shape}: points have shape (n, 3)")
    points = points[:, :3] if points.size else np.zeros((0, 3))
    check_cloud(points, name, remedy=remedy)
    return points
