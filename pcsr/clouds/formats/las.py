"""LAS and LAZ, as laser scanners of landscapes give them: laspy reads and writes them, where it is installed."""

import copy
import warnings
from contextlib import nullcontext
from io import BytesIO
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native, spread, unused
from pcsr.clouds.formats.laz import check_chunks, panics_as_errors
from pcsr.errors import UserError
from pcsr.extras import imported, remedy, require
from pcsr.limits import check_inflated

USER = "the format LAS"
"""What needs laspy, in a message to who hasn't got it."""
RANGE = 2**31 - 1
"""Coordinates are integers of 32 bits, times a scale, plus an offset."""
FINEST = 1e-9
"""The smallest scale that is chosen for a cloud that was not read from such a file."""
NAME_LENGTH = 32
RECORD, LONG_RECORD = 54, 60
"""Bytes of the smallest records of a header."""


def read(data: bytes) -> Cloud:
    """All dimensions, in the file's order; the header is kept, and with it scales, offsets and what else it says.

    Raises:
        UserError: laspy is not installed, or the file is cut off.
    """
    laspy = imported("laspy", USER)
    _check_counts(data)
    try:
        with warnings.catch_warnings(), panics_as_errors() if data[104] > 127 else nullcontext():
            warnings.simplefilter("ignore")  # of what it finds odd in a header
            las = laspy.read(BytesIO(data))
    except laspy.LaspyException as error:
        hint = f": {remedy(['lazrs'])}" if "LazBackend" in str(error) else ""
        raise UserError(f"laspy cannot read it: {error}{hint}") from error
    if len(las.points) != las.header.point_count:
        raise UserError(f"it is cut off: {len(las.points)} of its {las.header.point_count} points are there")
    names = [name for name in las.point_format.dimension_names if name not in ("X", "Y", "Z", "x", "y", "z")]
    columns = {name: native(np.array(las[name])) for name in names}
    return Cloud(np.array(las.xyz, np.float64, order="C"), columns, {"las": {"header": las.header}})


def _check_counts(data: bytes) -> None:
    """Check that what the header claims has room in the file: laspy would look for each record and point."""
    if len(data) < 227:
        raise UserError("it is cut off in its header")
    new = data[25] >= 4  # version 1.4 has long records, too, after the points, and more points
    claimed = _whole(data, 100, 4) * RECORD + (_whole(data, 243, 4) * LONG_RECORD if new else 0)
    if claimed > len(data):
        raise UserError("its header claims more records than the file has room for: it is cut off or damaged")
    count, size, compressed = (
        _whole(data, 247, 8) if new else _whole(data, 107, 4),
        _whole(data, 105, 2),
        data[104] > 127,
    )
    there = max(0, len(data) - _whole(data, 96, 4)) // max(size, 1)
    if there < count and not compressed:
        raise UserError(f"it is cut off: {there} of its {count} points are there")
    if compressed:
        check_inflated(len(data), count * size)
        check_chunks(data, _whole(data, 96, 4), size, count)


def _whole(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")


def write_las(cloud: Cloud) -> bytes:
    """The cloud with the scales, offsets and point format that it was read with, else with its own.

    Columns take the dimension of their name where that holds them, else an extra one. 8-bit colours are
    spread over 16 bits, as the format has it.

    Raises:
        UserError: laspy is not installed, or the coordinates are beyond what scale and offset allow.
    """
    return _write(cloud, compress=False)


def write_laz(cloud: Cloud) -> bytes:
    """The same, compressed."""
    return _write(cloud, compress=True)


def check_installed(*, compressed: bool) -> None:
    """Check that laspy is there, and for LAZ what it packs with.

    Raises:
        UserError: it is not; the message says what to install.
    """
    available = imported("laspy", USER).LazBackend.detect_available()
    if compressed and not available:
        require({"lazrs": "the format LAZ"})


def _write(cloud: Cloud, *, compress: bool) -> bytes:
    laspy = imported("laspy", USER)
    known = cloud.about.get("las", {}).get("header")
    colours = _wide(cloud.columns)
    header = copy.deepcopy(known) if known is not None else _header(laspy, cloud.points, bool(colours))
    of_header = set(header.point_format.dimension_names)
    columns = {name: column for name, column in cloud.columns.items() if name in of_header}
    flat = spread({name: column for name, column in cloud.columns.items() if name not in of_header}, rest=True)
    columns |= {unused(name, columns): column for name, column in flat.items()}
    if known is None:
        columns |= colours
    header.remove_extra_dims([name for name in header.point_format.extra_dimension_names if name not in columns])
    placed = {_place(header, laspy, name, column, columns): column for name, column in columns.items()}
    integers = np.rint((cloud.points - header.offsets) / header.scales)
    if np.abs(integers).max() > RANGE:
        raise UserError(
            f"the coordinates reach {np.abs(cloud.points).max():g}, beyond what the scales {list(header.scales)} and "
            f"offsets {list(header.offsets)} of the file that it was read from allow: write a .ply"
        )
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header))
    las.X, las.Y, las.Z = integers.astype(np.int32).T
    try:
        for name, column in placed.items():
            las[name] = _storable(column)
        file = BytesIO()
        las.write(file, do_compress=compress)
    except (laspy.LaspyException, OverflowError, ValueError) as error:
        hint = f": {remedy(['lazrs'])}" if "LazBackend" in str(error) else ""
        raise UserError(f"laspy cannot write the cloud: {error}{hint}") from error
    return file.getvalue()


def _header(laspy: Any, points: np.ndarray, coloured: bool) -> Any:
    header = laspy.LasHeader(version="1.4", point_format=7 if coloured else 6)
    header.offsets = np.floor(points.min(axis=0))
    extent = max(float((points - header.offsets).max()), FINEST)
    header.scales = np.full(3, max(FINEST, 10.0 ** np.ceil(np.log10(extent / RANGE))))
    return header


def _wide(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Red, green and blue in 16 bits; empty where they are not all there or no colours of a known range."""
    columns = spread(columns, rest=False)
    wide = {}
    for name in ("red", "green", "blue"):
        column = columns.get(name)
        if column is None:
            return {}
        if column.dtype == np.uint8:
            wide[name] = column.astype(np.uint16) * np.uint16(257)
        elif column.dtype == np.uint16:
            wide[name] = column
        elif column.dtype.kind == "f" and bool(((column >= 0) & (column <= 1)).all()):
            wide[name] = np.rint(column * 65535).astype(np.uint16)
        else:
            return {}
    return wide


def _place(header: Any, laspy: Any, name: str, column: np.ndarray, taken: dict[str, np.ndarray]) -> str:
    """The dimension that holds a column: the one of its name where it fits, else a new one."""
    point_format = header.point_format
    dimensions = {each.name: each for each in point_format.dimensions}
    if name in dimensions:
        if name in point_format.extra_dimension_names or _fits(column, dimensions[name]):
            return name
        name = unused(name, [*dimensions, *taken])
    if len(name.encode()) > NAME_LENGTH:
        raise UserError(f"the column name '{name}' is longer than the {NAME_LENGTH} bytes that LAS has: rename it")
    header.add_extra_dims([laspy.ExtraBytesParams(name=name, type=_storable(column).dtype)])
    return name


def _fits(column: np.ndarray, dimension: Any) -> bool:
    if dimension.dtype is None:
        whole = column.dtype.kind in "biu"
        return whole and bool((column >= 0).all()) and int(column.max()) < 2**dimension.num_bits
    with np.errstate(invalid="ignore", over="ignore"):
        return np.array_equal(column.astype(dimension.dtype).astype(np.float64), column.astype(np.float64), True)


def _storable(column: np.ndarray) -> np.ndarray:
    if column.dtype.kind == "b":
        return column.astype(np.uint8)
    if column.dtype.kind == "f" and column.dtype.itemsize not in (4, 8):
        return column.astype(np.float32 if column.dtype.itemsize < 4 else np.float64)
    return column
