"""Writing of clouds to files, and the checks before it."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import Bad
from pcsr.clouds.formats import las, pcd
from pcsr.clouds.formats.format_table import FINITE_ONLY, writer
from pcsr.errors import RunError, UserError
from pcsr.files import check_target, write_whole
from pcsr.geometry.checks import check_cloud


def writable(path: Path, cloud: Cloud | None = None, *, bad: Bad = "refuse") -> None:
    """Check that a cloud can be written to a path, before it is computed.

    Args:
        path: path of the file to write.
        cloud: cloud with the columns that are to be written, such as the sparse one. It is encoded on trial.
        bad: as in `write_cloud`.

    Raises:
        UserError: the suffix is unknown or can only be read, a library is missing, the path is a folder, a device, a
            pipe or a socket, or the format cannot hold `cloud`.
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
        _encoded(cloud, path.suffix, str(path), bad)


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


def write_points(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points to a file, completely or not at all. Reading the file returns the same doubles, but for LAS and LAZ.

    Raises:
        UserError: the suffix is unknown, there are no points, or points are not finite.
        RunError: the file cannot be written.
    """
    name = str(path)
    writer(path.suffix, name)
    points = np.asarray(points, np.float64)
    if points.size and (points.ndim != 2 or points.shape[1] < 3):
        raise UserError(f"{name} holds an array of shape {points.shape}: points have shape (n, 3)")
    write_cloud(path, Cloud(np.ascontiguousarray(points[:, :3] if points.size else np.zeros((0, 3)))))


def _write_bytes(part: Path, data: bytes) -> None:
    part.write_bytes(data)


def _encoded(cloud: Cloud, suffix: str, name: str, bad: Bad) -> bytes:
    encode = writer(suffix, name)
    if bad == "keep" and len(cloud):
        check_finite_only(cloud, suffix, name)
    else:
        check_cloud(cloud.points, name)
    try:
        return encode(cloud)
    except UserError as error:
        raise UserError(f"{name}: {error}") from error
    except MemoryError as error:
        raise RunError(f"{name} cannot be written: it needs more memory than is free") from error
    except Exception as error:  # libraries raise errors of any type, in their words
        raise UserError(f"{name}: a {suffix} file cannot hold this cloud: write a .ply or .npz file") from error
