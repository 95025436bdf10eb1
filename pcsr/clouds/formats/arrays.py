"""NumPy's files: an NPY of n rows, or an NPZ with `points` and an array for each column."""

import zipfile
from io import BytesIO

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native, spread, unused
from pcsr.errors import UserError, did_you_mean


def read_npy(data: bytes) -> Cloud:
    """An array (n, 3 + k); its further columns are called c3, c4 and so on, and keep its type.

    Raises:
        UserError: an array that holds no real numbers, or of another shape.
    """
    array = _numbers(np.load(BytesIO(data), allow_pickle=False))
    return _cloud(array, {}, {"npy": {"kind": array.dtype.str[1:]}})


def read_npz(data: bytes) -> Cloud:
    """The array `points`, or the only one, and each other array with one row for each point.

    Raises:
        UserError: no array is called `points`, or it holds no real numbers.
    """
    with np.load(BytesIO(data), allow_pickle=False) as arrays:
        names = list(arrays.files)
        name = "points" if "points" in names or len(names) != 1 else names[0]
        if name not in names:
            hint = did_you_mean("points", names)
            raise UserError(f"it holds {len(names)} arrays, none of them 'points': {hint}; rename the right one")
        points = _numbers(arrays[name])
        others = {other: np.asarray(arrays[other]) for other in names if other != name}
    fits = {
        other
        for other, array in others.items()
        if array.dtype.kind in "biuf" and array.ndim in (1, 2) and len(array) == len(points) and other not in "xyz"
    }
    cloud = _cloud(points, {other: native(others[other]) for other in others if other in fits}, {})
    left_out = sorted(others.keys() - fits)
    return Cloud(cloud.points, cloud.columns, {"left out": left_out} if left_out else {})


def _numbers(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iuf":
        raise UserError(f"it holds {array.dtype}: points are real numbers")
    if array.size == 0:
        raise UserError("it holds no points")
    if array.ndim != 2 or array.shape[1] < 3:
        raise UserError(f"it holds an array of shape {array.shape}: points are (n, 3)")
    return array


def _cloud(array: np.ndarray, columns: dict[str, np.ndarray], about: dict[str, dict[str, str]]) -> Cloud:
    beside = {unused(f"c{i}", columns): native(array[:, i]) for i in range(3, array.shape[1])}
    return Cloud(array[:, :3].astype(np.float64), beside | columns, about)


def write_npy(cloud: Cloud) -> bytes:
    """One array: the coordinates, then all columns, without their names.

    Of the type that it was read with where that holds everything, else of doubles.

    Raises:
        UserError: a column holds integers that doubles don't hold.
    """
    columns = spread(cloud.columns, rest=True)
    for name, column in columns.items():
        if column.dtype.kind in "iu" and max(-int(column.min()), int(column.max())) > 2**53:
            raise UserError(f"an .npy of doubles can't hold the large integers of column '{name}': write a .npz")
    table = np.column_stack([cloud.points, *(column.astype(np.float64) for column in columns.values())])
    kind = np.dtype(cloud.about.get("npy", {}).get("kind", "f8"))
    with np.errstate(over="ignore", invalid="ignore"):
        cast = table.astype(kind)
    file = BytesIO()
    np.save(file, cast if np.array_equal(cast.astype(np.float64), table, equal_nan=True) else table, allow_pickle=False)
    return file.getvalue()


def write_npz(cloud: Cloud) -> bytes:
    """An array `points` and one for each column, of their own types.

    Raises:
        UserError: a column is called `points`, or as no array can be.
    """
    file = BytesIO()
    # Not np.savez: it takes the names as arguments, and has some of its own.
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in [("points", cloud.points), *cloud.columns.items()]:
            if f"{name}.npy" in archive.namelist():
                raise UserError(f"a .npz holds one array '{name}', and that is of the coordinates: rename the column")
            with archive.open(f"{name}.npy", "w", force_zip64=True) as part:
                np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
    return file.getvalue()
