"""Points and fields of messages sensor_msgs/PointCloud2."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from pcsr.errors import UserError
from pcsr.limits import MOST_COLUMNS

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
"""Type of the messages."""
KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy's types of fields, by their numbers in sensor_msgs/PointField."""
MOST_BYTES = 8 * MOST_COLUMNS
"""Largest size of a point in bytes."""


def table(message: Any) -> np.ndarray:
    """Return the points of a message as a structured array (n,), a view of its data.

    Fields that have the name of an earlier one, or none, are left out.

    Raises:
        UserError: the message claims more points than it has data for, or its fields contradict one another.
    """
    columns, rows = int(message.width), int(message.height)
    step, row_step, size = int(message.point_step), int(message.row_step), len(message.data)
    kind = _kind(message, step)
    row_step = columns * step if rows <= 1 else row_step  # some programs leave it 0
    if columns == 0 or rows == 0:
        return np.zeros(0, kind)
    needed = (rows - 1) * row_step + columns * step
    if row_step < columns * step or needed > size:
        raise UserError(
            f"it claims {rows} rows of {columns} points, of {step} bytes each and {row_step} each row, and has "
            f"{size} bytes: it is damaged"
        )
    grid = np.ndarray((rows, columns), kind, message.data, strides=(row_step, step))
    return grid.reshape(-1)


def coordinates(points: np.ndarray) -> Float64[np.ndarray, "n 3"]:
    """Return the coordinates x, y and z of a table.

    Raises:
        UserError: it lacks one of them, or one of them is no float.
    """
    kinds = {name: points.dtype[name] for name in points.dtype.names or ()}
    if any(axis not in kinds or kinds[axis].kind != "f" for axis in "xyz"):
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items())
        raise UserError(f"it needs the fields x, y and z, of float32 or float64, and has {found[:200] or 'none'}")
    return np.stack([points[axis].astype(np.float64) for axis in "xyz"], axis=-1)


def _kind(message: Any, step: int) -> np.dtype[Any]:
    """Return NumPy's type of a point.

    Raises:
        UserError: a point is too large, or a field has an unknown type or does not fit into a point.
    """
    if step > MOST_BYTES:
        raise UserError(f"its points have {step} bytes each, and {MOST_BYTES} are the most: it is damaged")
    order = ">" if message.is_bigendian else "<"
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    for field in message.fields:
        count, offset = max(1, int(field.count)), int(field.offset)  # some programs leave the count 0
        if field.datatype not in KINDS:
            raise UserError(f"its field '{field.name[:80]}' has the type {field.datatype}, which no PointCloud2 has")
        kind = np.dtype(order + KINDS[field.datatype])
        if offset + count * kind.itemsize > step:
            raise UserError(
                f"its field '{field.name[:80]}', {count} numbers from byte {offset} on, does not fit into its points "
                f"of {step} bytes: it is damaged"
            )
        if field.name and field.name not in names:
            names.append(field.name)
            formats.append(kind if count == 1 else (kind, (count,)))
            offsets.append(offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})
