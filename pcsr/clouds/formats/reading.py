"""Reading of clouds from files, pipes and bytes."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import Bad
from pcsr.clouds.formats import rosbag
from pcsr.clouds.formats.beginnings import check_start
from pcsr.clouds.formats.format_table import ROSBAG, TEXT_READERS, check_columns, format_of, memory, reader
from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_cloud
from pcsr.inputs import HEAD, Readable, read_bytes, read_pipe
from pcsr.limits import LARGEST_PIPE
from pcsr.ros.paths import bag_and_topic

TOO_LARGE = "convert it to LAS, LAZ, binary PLY or NPY, which `pcsr upsample` reads in parts, or split it"
"""Remedy for files that do not fit into memory."""
LONGEST = 500
"""Longest reason in a message, in characters."""


def read_cloud(
    path: Path,
    suffix: str | None = None,
    *,
    bad: Bad = "refuse",
    columns: str | Sequence[str] | None = None,
) -> Cloud:
    """Read a cloud with all of its columns from a file; of a mesh, the vertices; of a ROS bag, the last of a topic.

    Args:
        path: path of the file; that of a bag may end with a topic: scan.mcap:/camera/points.
        suffix: suffix or name of the format, such as ".ply" or "kitti"; by default that of the path's name.
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
    kind, name = format_of(path, suffix), str(path)
    if kind == ROSBAG:
        check_columns(columns, kind, name)
        return _complete(_read_bag(path, name), name, bad)
    read = _reader(kind, name, columns)
    return _complete(_read(_content(path, kind), kind, name, read), name, bad)


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
        suffix: suffix or name of the format, such as ".ply" or "kitti".
        name: name of the pipe, for messages.
        bad: as in `read_cloud`.
        columns: as in `read_cloud`.
        most: largest number of bytes to read.

    Raises:
        UserError: as `read_cloud`, or the pipe has more than `most` bytes.

    Warns:
        PcsrWarning: as `read_cloud`.
    """
    kind = format_of(Path(), suffix)
    read = _reader(kind, name, columns)
    data = read_pipe(file, name, most=most, memory=memory(kind), check=partial(check_start, suffix=kind, name=name))
    return _complete(_read(data, kind, name, read), name, bad)


def read_points(
    path: Path, suffix: str | None = None, *, columns: str | Sequence[str] | None = None
) -> Float[np.ndarray, "n 3"]:
    """Read the points of a file without its columns, in its frame and unit.

    Args:
        path: path of the file.
        suffix: suffix or name of the format; by default that of the path's name.
        columns: names of the columns of a text file, as in `read_cloud`; other files are read without them.

    Raises:
        UserError: as `read_cloud`.

    Warns:
        PcsrWarning: as `read_cloud`.
    """
    kind, name = format_of(path, suffix), str(path)
    if kind == ROSBAG:
        cloud = _read_bag(path, name)
    else:
        read = _reader(kind, name, None)
        if kind in TEXT_READERS:
            read = partial(TEXT_READERS[kind], columns=columns, all_columns=False)
        cloud = _read(_content(path, kind), kind, name, read)
    check_cloud(cloud.points, name)
    return cloud.points


def _content(path: Path, kind: str) -> bytes:
    check = partial(check_start, suffix=kind, name=str(path))
    return read_bytes(path, memory=memory(kind), check=check, remedy=TOO_LARGE)


def _reader(kind: str, name: str, columns: str | Sequence[str] | None) -> Callable[[bytes], Cloud]:
    """Return the reader of a format, for given names of columns.

    Raises:
        UserError: the format is unknown, or takes no names of columns.
    """
    read = reader(kind, name)
    check_columns(columns, kind, name)
    return read if columns is None else partial(TEXT_READERS[kind], columns=columns)


def _read(data: bytes, kind: str, name: str, read: Callable[[bytes], Cloud]) -> Cloud:
    """Read a cloud from the content of a file, and warn of what the reader left out or guessed."""
    check_start(data[:HEAD], kind, name)
    return _checked(partial(read, data), kind, name)


def _read_bag(path: Path, name: str) -> Cloud:
    """Read a cloud of a bag, and warn of what was left out."""
    bag, topic = bag_and_topic(path) or (path, None)
    return _checked(partial(rosbag.read, bag, topic), ROSBAG, name, begins=str(bag))


def _checked(read: Callable[[], Cloud], kind: str, name: str, begins: str | None = None) -> Cloud:
    """Call a reader; name the file in its errors, unless they begin with `begins`, and warn of its notes."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond doubles are found later, as not finite
            cloud = read()
    except UserError as error:
        reason = str(error).encode("utf-8", "replace").decode()  # may quote long or broken text of the file
        reason = reason if len(reason) <= LONGEST else reason[:LONGEST] + "…"
        raise UserError(reason if begins and reason.startswith(begins) else f"{name}: {reason}") from error
    except MemoryError as error:
        raise UserError(f"{name} cannot be read: it needs more memory than is free") from error
    except Exception as error:  # malformed files make libraries raise errors of any type, in their words
        raise UserError(
            f"{name} cannot be read as a {kind} file: it is damaged, or of another format: get the file again, or "
            f"save it anew"
        ) from error
    if not len(cloud):
        raise UserError(f"{name} holds no points")
    for note in cloud.about.get("notes", ()):
        warnings.warn(f"{name}: {note}", PcsrWarning, stacklevel=4)
    return cloud


def _complete(cloud: Cloud, name: str, bad: Bad) -> Cloud:
    """Return a cloud whose points that are not finite were refused, dropped or kept."""
    if bad == "drop":
        finite = np.isfinite(cloud.points).all(axis=1)
        dropped = len(cloud) - int(finite.sum())
        if dropped == len(cloud):
            raise UserError(f"{name}: none of its {dropped} points has coordinates that are all finite")
        cloud = cloud.chosen(finite) if dropped else cloud
        return replace(cloud, about={**cloud.about, "dropped": dropped})
    if bad == "refuse":
        check_cloud(cloud.points, name, remedy=", or have them dropped: --bad drop")
    return cloud
