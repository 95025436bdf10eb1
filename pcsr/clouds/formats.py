"""Clouds as files: PLY, PCD, text, CSV and NumPy's. Coordinates are doubles, and are written as such."""

import csv
import re
import textwrap
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError, did_you_mean
from pcsr.files import write_whole

T = TypeVar("T")
PLY_HEADER = """ply
format binary_little_endian 1.0
element vertex {count}
property double x
property double y
property double z
end_header
"""


def read_points(path: Path) -> Float[np.ndarray, "n 3"]:
    """The points of a file, by its suffix; of a mesh, its vertices. In the file's own frame and unit.

    Text has three numbers or more on a line, parted by white space or commas; lines that start with # or //
    are comments. A first line of names is allowed, and where x, y and z are among them they are what is read.

    Raises:
        UserError: no such file, an unknown suffix, a file that is damaged or holds no points, or points that
            are not finite.
    """
    read = _by_suffix(path, READERS)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
    try:
        points = np.asarray(read(data), np.float64)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error
    except Exception as error:  # the readers raise whatever a malformed file makes them trip over
        reason = textwrap.shorten(str(error), 200) or type(error).__name__
        raise UserError(f"{path} cannot be read as a {path.suffix.lower()} cloud: {reason}") from error
    return _checked(points, str(path))


def write_points(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points by the suffix of `path`, whole or not at all; reading gives the same doubles.

    Raises:
        UserError: an unknown suffix, no points, or points that are not finite.
        RunError: the file cannot be written.
    """
    encode = _by_suffix(path, WRITERS)
    data = encode(np.ascontiguousarray(_checked(np.asarray(points, np.float64), str(path))))

    def write(part: Path) -> None:
        part.write_bytes(data)

    write_whole(path, write)


def _by_suffix(path: Path, known: dict[str, T]) -> T:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise UserError(f"{path}: no cloud format '{suffix}': {', '.join(sorted(known))} are known")
    return known[suffix]


def _checked(points: np.ndarray, name: str) -> Float[np.ndarray, "n 3"]:
    if points.size == 0:
        raise UserError(f"{name} holds no points")
    if points.ndim != 2 or points.shape[1] < 3:
        raise UserError(f"{name} holds an array of shape {points.shape}: points are (n, 3)")
    points = points[:, :3]
    bad = int((~np.isfinite(points).all(axis=1)).sum())
    if bad:
        raise UserError(f"{name}: {bad} of {len(points)} points have a coordinate that is not finite: remove them")
    return points


def _read_ply(data: bytes) -> np.ndarray:
    import trimesh

    # From memory, so that no file beside it is looked for; unprocessed, so that no vertex is merged or dropped.
    loaded = trimesh.load(BytesIO(data), file_type="ply", process=False)
    points = np.asarray(getattr(loaded, "vertices", ()))
    told = re.search(rb"^element vertex (\d+)", data, re.MULTILINE)  # trimesh takes text that ends early as it is
    if told and int(told[1]) != len(points):
        raise UserError(f"it is cut off: {len(points)} of its {int(told[1])} points are there")
    return points


def _read_pcd(data: bytes) -> np.ndarray:
    from pypcd4.pypcd4 import PointCloud

    cloud = PointCloud.from_fileobj(BytesIO(data))  # type: ignore[arg-type]
    missing = [name for name in "xyz" if name not in cloud.fields]
    if missing:
        raise UserError(f"it has no field {', '.join(missing)}, only {', '.join(cloud.fields)}")
    columns = np.atleast_1d(cloud.pc_data)
    if len(columns) != cloud.points:
        raise UserError(f"it is cut off: {len(columns)} of its {cloud.points} points are there")
    # One by one: what is beside them, colour say, may be of a type that holds no doubles.
    return np.stack([np.asarray(columns[name], np.float64) for name in "xyz"], axis=-1)


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """The lines that are neither empty nor a comment, with their numbers."""
    for number, line in enumerate(data.decode("utf-8-sig").splitlines(), 1):
        text = line.strip()
        if text and not text.startswith(("#", "//")):
            yield number, text


def _read_text(data: bytes) -> np.ndarray:
    return _table([(number, line.replace(",", " ").split()) for number, line in _lines(data)], named=False)


def _read_csv(data: bytes) -> np.ndarray:
    rows = [
        (number, [word.strip() for word in next(csv.reader([line], skipinitialspace=True))])
        for number, line in _lines(data)
    ]
    return _table(rows, named=True)


def _table(rows: list[tuple[int, list[str]]], named: bool) -> np.ndarray:
    """Three columns of a table of words, with or without a row of names.

    Args:
        rows: each with the number of its line.
        named: whether names must include x, y and z.
    """
    columns = [0, 1, 2]
    if rows and not any(_is_number(word) for word in rows[0][1]):
        names = [word.lower() for word in rows.pop(0)[1]]
        if all(name in names for name in "xyz"):
            columns = [names.index(name) for name in "xyz"]
        elif named:
            raise UserError(f"its columns are {', '.join(names)}: name those of the coordinates x, y and z")
    points = []
    for number, words in rows:
        if len(words) <= max(columns):
            raise UserError(f"line {number} has {len(words)} columns, at least {max(columns) + 1} are needed")
        try:
            points.append([float(words[column]) for column in columns])
        except ValueError as error:
            raise UserError(f"line {number}: {error}") from error
    return np.array(points, np.float64).reshape(-1, 3)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_npy(data: bytes) -> np.ndarray:
    return _numbers(np.load(BytesIO(data), allow_pickle=False))


def _read_npz(data: bytes) -> np.ndarray:
    with np.load(BytesIO(data), allow_pickle=False) as arrays:
        names = list(arrays.files)
        name = "points" if "points" in names or len(names) != 1 else names[0]
        if name not in names:
            hint = did_you_mean("points", names)
            raise UserError(f"it holds {len(names)} arrays, none of them 'points': {hint}; rename the right one")
        return _numbers(arrays[name])


def _numbers(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind not in "iuf":
        raise UserError(f"it holds {array.dtype}: points are real numbers")
    return array


def _write_ply(points: Float[np.ndarray, "n 3"]) -> bytes:
    return PLY_HEADER.format(count=len(points)).encode() + points.astype("<f8").tobytes()


def _write_pcd(points: Float[np.ndarray, "n 3"]) -> bytes:
    from pypcd4.pypcd4 import PointCloud

    file = BytesIO()
    PointCloud.from_points(points, ("x", "y", "z"), (np.float64,) * 3).save(file)
    return file.getvalue()


def _write_npy(points: Float[np.ndarray, "n 3"]) -> bytes:
    file = BytesIO()
    np.save(file, points, allow_pickle=False)
    return file.getvalue()


def _write_npz(points: Float[np.ndarray, "n 3"]) -> bytes:
    file = BytesIO()
    np.savez(file, points=points)
    return file.getvalue()


def _write_text(points: Float[np.ndarray, "n 3"], gap: str = " ", header: str = "") -> bytes:
    # repr gives the shortest digits that read back as the same double.
    return (header + "".join(gap.join(map(repr, point)) + "\n" for point in points.tolist())).encode()


def _write_csv(points: Float[np.ndarray, "n 3"]) -> bytes:
    return _write_text(points, ",", "x,y,z\n")


READERS: dict[str, Callable[[bytes], np.ndarray]] = {
    ".ply": _read_ply,
    ".pcd": _read_pcd,
    ".xyz": _read_text,
    ".txt": _read_text,
    ".csv": _read_csv,
    ".npy": _read_npy,
    ".npz": _read_npz,
}
WRITERS: dict[str, Callable[[np.ndarray], bytes]] = {
    ".ply": _write_ply,
    ".pcd": _write_pcd,
    ".xyz": _write_text,
    ".txt": _write_text,
    ".csv": _write_csv,
    ".npy": _write_npy,
    ".npz": _write_npz,
}
