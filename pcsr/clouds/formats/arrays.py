"""NumPy's formats: NPY with an array of n rows, and NPZ with `points` and an array for each column."""

import zipfile
from io import BufferedIOBase, BytesIO
from pathlib import PurePosixPath
from typing import Any, cast

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native, spread, unused
from pcsr.clouds.npy import read_array
from pcsr.errors import UserError, did_you_mean
from pcsr.limits import MOST_COLUMNS, check_inflated

DIRECTORY = 1 << 20
"""Largest size in bytes of an archive's directory: about 10,000 arrays."""


def read_npy(data: bytes) -> Cloud:
    """Read an array (n, 3 + k). The columns beside the coordinates get the names c3, c4 and so on.

    Raises:
        UserError: the array has another shape or does not hold real numbers.
    """
    return rows_cloud(read_array(BytesIO(data), len(data)))


def rows_cloud(array: np.ndarray) -> Cloud:
    """Return the cloud of an array (n, 3 + k), as `read_npy`.

    Raises:
        UserError: the array has another shape or does not hold real numbers.
    """
    array = _numbers(array)
    kind = array.dtype.str[1:]
    return _cloud(array, {}, {"npy": {"kind": kind, "coordinates": kind}})


def read_npz(data: bytes) -> Cloud:
    """Read the array `points`, or the only array, and as columns all other arrays with one row for each point.

    Raises:
        UserError: there is no array `points`, or it does not hold real numbers.
    """
    _check_directory(data)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        infos = archive.infolist()
        members = {info.filename.removesuffix(".npy"): info for info in infos if info.filename.endswith(".npy")}
        if len({info.filename for info in infos}) < len(infos):
            raise UserError("two of its arrays have one name: rename one of them")
        name = "points" if "points" in members or len(members) != 1 else next(iter(members))
        if name not in members:
            hint = did_you_mean("points", members)
            raise UserError(f"it holds {len(members)} arrays, none of them 'points': {hint}; rename the right one")
        check_inflated(len(data), sum(info.file_size for info in members.values()))
        points = _numbers(_member(archive, members[name]))
        left_out = [PurePosixPath(info.filename).name for info in infos if not info.filename.endswith(".npy")]
        columns: dict[str, np.ndarray] = {}
        for other, info in members.items():
            if other == name:
                continue
            array = _member(archive, info)
            if array.dtype.kind in "biuf" and array.ndim in (1, 2) and len(array) == len(points) and other not in "xyz":
                columns[other] = native(array)
            else:
                left_out.append(other)
    cloud = _cloud(points, columns, {})
    about: dict[str, Any] = {"npz": {"coordinates": points.dtype.str[1:]}}
    if left_out:
        what = ", ".join(sorted(left_out))[:200]
        note = (
            f"its {what} were left out: columns are arrays of numbers with a row for each of the {len(points)} points"
        )
        about |= {"left out": sorted(left_out), "notes": (note,)}
    return Cloud(cloud.points, cloud.columns, about)


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise UserError(f"'{info.filename}' is compressed by a method that NumPy does not use: save it by numpy.savez")
    with archive.open(info) as file:
        try:
            array = read_array(cast(BufferedIOBase, file), info.file_size)
            if file.read(1):  # reading to the end also checks the checksum
                raise UserError("it goes on after its array: get the file again")
            return array
        except UserError as error:
            raise UserError(f"{info.filename}: {error}") from error


def _check_directory(data: bytes) -> None:
    """Check the size of an archive's directory, since each file in it takes a kilobyte of memory.

    Raises:
        UserError: it is larger than `DIRECTORY`, or missing.
    """
    end = data.rfind(b"PK\5\6", max(0, len(data) - (1 << 16) - 22))
    if end < 0:
        raise UserError("it is cut off: the directory at its end is missing")
    size = int.from_bytes(data[end + 12 : end + 16], "little")
    if data[max(0, end - 20) : end].startswith(b"PK\6\7"):  # ZIP64, with sizes of 8 bytes
        large = data.rfind(b"PK\6\6", max(0, end - DIRECTORY), end)
        size = int.from_bytes(data[large + 40 : large + 48], "little")
    if size > DIRECTORY:
        raise UserError(f"its directory has {size} bytes, more than {DIRECTORY}: save fewer arrays in it")


def _numbers(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iuf":
        raise UserError(f"it holds {str(array.dtype)[:80]}: points are real numbers")
    if array.size == 0:
        raise UserError("it holds no points")
    if array.ndim != 2 or array.shape[1] < 3:
        raise UserError(f"it holds an array of shape {array.shape}: points are (n, 3)")
    return array


def _cloud(array: np.ndarray, columns: dict[str, np.ndarray], about: dict[str, dict[str, str]]) -> Cloud:
    if array.shape[1] > MOST_COLUMNS:
        raise UserError(f"it has {array.shape[1]} columns, and {MOST_COLUMNS} are the most: remove some")
    unnamed = {unused(f"c{i}", columns): native(array[:, i]) for i in range(3, array.shape[1])}
    return Cloud(array[:, :3].astype(np.float64), unnamed | columns, about)


def write_npy(cloud: Cloud) -> bytes:
    """Write one array of the coordinates and then all columns, without their names.

    The array has the type that it was read with, if that represents all values exactly; otherwise double precision.

    Raises:
        UserError: a column has integers that double precision cannot represent.
    """
    file = BytesIO()
    np.save(file, table(cloud), allow_pickle=False)
    return file.getvalue()


def table(cloud: Cloud) -> np.ndarray:
    """Return the array (n, 3 + k) of a cloud that `write_npy` writes.

    Raises:
        UserError: a column has integers that double precision cannot represent.
    """
    columns = spread(cloud.columns, rest=True)
    for name, column in columns.items():
        if column.dtype.kind in "iu" and max(-int(column.min()), int(column.max())) > 2**53:
            raise UserError(f"an .npy of doubles can't hold the large integers of column '{name}': write a .npz file")
    doubles = np.column_stack([cloud.points, *(column.astype(np.float64) for column in columns.values())])
    kind = np.dtype(cloud.about.get("npy", {}).get("kind", "f8"))
    with np.errstate(over="ignore", invalid="ignore"):
        cast = doubles.astype(kind)
    return cast if np.array_equal(cast.astype(np.float64), doubles, equal_nan=True) else doubles


def write_npz(cloud: Cloud) -> bytes:
    """Write an array `points` and an array for each column, of its own type.

    Raises:
        UserError: two arrays would have the same name.
    """
    file = BytesIO()
    # np.savez takes names as keyword arguments, so that some names would collide with its parameters.
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in [("points", cloud.points), *cloud.columns.items()]:
            if f"{name}.npy" in archive.namelist():
                raise UserError(f"a .npz holds one array '{name}', and that is of the coordinates: rename the column")
            with archive.open(f"{name}.npy", "w", force_zip64=True) as part:
                np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
    return file.getvalue()
