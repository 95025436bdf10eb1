"""The formats of clouds: reader, writer and memory of each, and the choice of a file's format."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import (
    arrays,
    binary,
    colmap,
    e57,
    las,
    mesh,
    obj_writing,
    pcd,
    ply,
    ply_writing,
    pts,
    ptx,
    text,
)
from pcsr.errors import UserError
from pcsr.ros.paths import SUFFIXES, bag_and_topic

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
    ".e57": e57.read,
}
"""Readers by the suffix of the file."""
TEXT_READERS: dict[str, Callable[..., Cloud]] = {
    ".xyz": text.read_xyz,
    ".txt": text.read_xyz,
    ".asc": text.read_xyz,
    ".csv": text.read_csv,
    ".pts": pts.read_pts,
}
"""Those of them that take names of columns."""
NAMED_READERS: dict[str, Callable[[bytes], Cloud]] = {
    "kitti": binary.read_kitti,
    "nuscenes": binary.read_nuscenes,
    "colmap": colmap.read,
}
"""Readers of formats without a suffix of their own, by the name of the format."""
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
    ".obj": obj_writing.write,
    ".las": las.write_las,
    ".laz": las.write_laz,
}
"""Writers by the suffix of the file."""
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
LEAST_MEMORY = 3.0
"""Peak memory of reading a file of a kind that `MEMORY` does not list, relative to the size of the file."""
FINITE_ONLY = (".las", ".laz", ".obj")
"""Formats whose coordinates are finite: those of LAS are integers, and few readers of OBJ take others."""
BIN = {
    "kitti": "float32 x y z intensity",
    "nuscenes": "float32 x y z intensity ring",
    "colmap": "points3D.bin",
}
"""What a file with the suffix .bin may hold, by the name of the format."""
ROSBAG = "rosbag"
"""Name of the format of a cloud in a ROS bag, which is read by its path: `pcsr.clouds.formats.rosbag.read`."""
COLMAP_FILE = "points3d.bin"
"""Name of COLMAP's file of points, in small letters."""


def format_of(path: Path, chosen: str | None = None) -> str:
    """Return the format of a file: the chosen one, or else that of the file's name.

    Args:
        path: path of the file.
        chosen: suffix or name of a format, such as ".ply", "ply" or "kitti".

    Returns:
        A key of `CLOUD_READERS` or `NAMED_READERS`, `ROSBAG`, or the suffix of `path` if that is unknown.

    Raises:
        UserError: the suffix is .bin, which several formats have.
    """
    if chosen is not None:
        name = chosen.lower().removeprefix(".")
        if name == ROSBAG or f".{name}" in SUFFIXES:
            return ROSBAG
        return name if name in NAMED_READERS else f".{name}"
    if bag_and_topic(path) is not None:
        return ROSBAG
    if path.name.lower() == COLMAP_FILE:
        return "colmap"
    if path.suffix.lower() == ".bin":
        choices = "; ".join(f"--format {name} ({holds})" for name, holds in BIN.items())
        raise UserError(f"{path}: files of several formats end with .bin: name the right one, {choices}")
    return path.suffix.lower()


def named_by(path: Path) -> bool:
    """Return whether the format of a file follows from its name."""
    known = path.suffix.lower() in CLOUD_READERS or path.name.lower() == COLMAP_FILE
    return known or bag_and_topic(path) is not None


def without_suffix(path: Path) -> bool:
    """Return whether the name of a file has no suffix by which its format is known, and is no path of a bag."""
    return path.suffix == "" and bag_and_topic(path) is None


def check_columns(columns: str | Sequence[str] | None, kind: str, name: str) -> None:
    """Check that names of columns are given for a format that takes them.

    Args:
        columns: names of the columns, or None.
        kind: suffix or name of the format.
        name: name of the file, for the message.

    Raises:
        UserError: they are given for another.
    """
    if columns is not None and kind not in TEXT_READERS:
        raise UserError(
            f"{name} is a {kind} file, whose format names its columns or fixes their order: "
            f"--columns is for {', '.join(sorted(TEXT_READERS))}"
        )


def memory(kind: str) -> float:
    """Return the peak memory of reading a file of a format, relative to the size of the file."""
    return MEMORY.get(kind, LEAST_MEMORY)


def reader(kind: str, name: str) -> Callable[[bytes], Cloud]:
    """Return the reader of a format.

    Args:
        kind: suffix or name of the format.
        name: name of the file, for the message.

    Raises:
        UserError: the format is unknown.
    """
    if kind in NAMED_READERS:
        return NAMED_READERS[kind]
    if kind == ROSBAG:
        raise UserError(f"{name}: a bag is read by its path: name a .bag, .mcap or .db3 file, or a folder of ROS 2")
    return _found(kind, CLOUD_READERS, name, f"are known, and by --format {', '.join(NAMED_READERS)}")


def writer(suffix: str, name: str) -> Callable[[Cloud], bytes]:
    """Return the writer of a format.

    Args:
        suffix: suffix of the format.
        name: name of the file, for the message.

    Raises:
        UserError: the format is unknown, or can only be read.
    """
    return _found(suffix, CLOUD_WRITERS, name, "can be written" if suffix.lower() in CLOUD_READERS else "are known")


def _found(kind: str, known: Mapping[str, T], name: str, verb: str) -> T:
    kind = kind.lower()
    if kind not in known:
        raise UserError(f"{name}: no cloud format '{kind}': {', '.join(sorted(known))} {verb}")
    return known[kind]
