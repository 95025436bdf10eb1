"""Writer of PLY files: vertices with all columns of a cloud."""

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import one_word_names, spread
from pcsr.clouds.formats.colours import in_bytes
from pcsr.clouds.formats.digits import words
from pcsr.clouds.formats.ply_header import ORDERS, TYPES
from pcsr.clouds.formats.precision import coordinates
from pcsr.errors import UserError

NAMES = {code: name for name, code in TYPES.items()}
"""PLY type of each of NumPy's types."""


def write(cloud: Cloud) -> bytes:
    """Write a cloud as PLY, in the encoding that it was read in, or binary.

    Coordinates are written in single precision if they were read so and need no more, otherwise in double precision.
    Columns keep their types, but colours of other formats are written in 8 bits. Types that PLY lacks are replaced by
    the smallest PLY type that represents all values, such as 32-bit for 64-bit integers.

    Raises:
        UserError: no PLY type represents the integers of a column.
    """
    properties, rows = table(cloud)
    start = header(cloud, properties, len(cloud))
    if _encoding(cloud) != "ascii":
        return start + rows.tobytes()
    fields = [rows[name] for name in rows.dtype.names or ()]
    numbers = [each for field in fields for each in (field.T if field.ndim == 2 else [field])]
    return start + "".join(" ".join(row) + "\n" for row in zip(*map(words, numbers), strict=True)).encode()


def header(cloud: Cloud, properties: list[str], count: int) -> bytes:
    """Return the header of a file, in the encoding and with the comments that the cloud was read with.

    Args:
        cloud: a cloud with these properties.
        properties: lines of the properties.
        count: number of points.
    """
    comments = cloud.about.get("ply", {}).get("comments", ())
    lines = ["ply", f"format {_encoding(cloud)} 1.0", *comments, f"element vertex {count}", *properties, "end_header"]
    return "".join(line + "\n" for line in lines).encode("utf-8", "surrogateescape")


def table(cloud: Cloud) -> tuple[list[str], np.ndarray]:
    """Return the header's lines of a cloud's properties, and its rows as a binary file holds them.

    Raises:
        UserError: no PLY type represents the integers of a column.
    """
    columns: dict[str, np.ndarray] = dict(zip("xyz", coordinates(cloud).T, strict=True))
    flat = spread(cloud.columns, rest=False)
    for name, column in one_word_names(flat if "ply" in cloud.about else in_bytes(flat)).items():
        columns[name] = column.astype(smallest(column, name), copy=False)
    order = ORDERS[_encoding(cloud)]
    lines: list[str] = []
    parts: list[tuple[str, str, tuple[int, ...]]] = []
    values: list[np.ndarray] = []
    for number, (name, column) in enumerate(columns.items()):
        code = column.dtype.str[1:]
        if column.ndim == 2:
            length = "uchar" if column.shape[1] < 256 else "uint"
            lines.append(f"property list {length} {NAMES[code]} {name}")
            parts.append((f"length {number}", order + TYPES[length], ()))
            values.append(np.full(len(cloud), column.shape[1], TYPES[length]))
        else:
            lines.append(f"property {NAMES[code]} {name}")
        parts.append((f"{number}", order + code, column.shape[1:]))
        values.append(column)
    rows = np.zeros(len(cloud), parts)
    for (name, _, _), value in zip(parts, values, strict=True):
        rows[name] = value
    return lines, rows


def _encoding(cloud: Cloud) -> str:
    encoding: str = cloud.about.get("ply", {}).get("encoding", "binary_little_endian")
    return encoding


def smallest(column: np.ndarray, name: str) -> np.dtype:
    """Return the type of a column if PLY has it, otherwise the smallest PLY type that represents all its values.

    Raises:
        UserError: the column has integers that neither 32 bits nor double precision represent.
    """
    if column.dtype.str[1:] in NAMES:
        return column.dtype
    if column.dtype.kind == "f":
        return np.dtype(np.float32 if column.dtype.itemsize < 4 else np.float64)
    low, high = (int(column.min()), int(column.max())) if column.size else (0, 0)
    for kind in ("u1", "i4", "u4"):
        if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max:
            return np.dtype(kind)
    if max(-low, high) <= 2**53:
        return np.dtype(np.float64)
    raise UserError(f"a .ply file holds no integers as large as those of column '{name}': write a .npz file")
