"""LAS and LAZ, the formats of airborne laser scanning, by laspy (extra `[las]`)."""

import copy
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from io import BytesIO
from mmap import mmap
from typing import Any, TypeAlias

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native, spread, unused
from pcsr.clouds.formats.laz import check_chunks, panics_as_errors
from pcsr.errors import UserError
from pcsr.extras import imported, require
from pcsr.limits import check_inflated

Data: TypeAlias = bytes | mmap

USER = "the format LAS"
"""Feature that needs laspy, for the message if it is not installed."""
HEADER, COMPRESSION, UNCOMPRESSED = 227, 104, 127
"""Size of the smallest header in bytes, the byte that says whether points are compressed, and the largest value of it
for points that are not."""
RANGE = 2**31 - 1
"""Largest stored coordinate. LAS stores coordinates as 32-bit integers, times a scale, plus an offset."""
SMALLEST = 1e-290
"""Smallest scale. Those near the smallest double lose digits."""
COPC = "copc"
"""User id of the records that make a LAZ file a COPC: the place of its octree, and the octree."""
NAME_LENGTH = 32
"""Longest name of a dimension, in bytes."""
RECORD, LONG_RECORD = 54, 60
"""Sizes in bytes of the headers of variable-length records and of extended ones."""


def read(data: bytes) -> Cloud:
    """Read all dimensions in the file's order, and keep the header for writing.

    Raises:
        UserError: laspy is not installed, or the file is cut off or damaged.
    """
    laspy = imported("laspy", USER)
    check_counts(data)
    if data[COMPRESSION] > UNCOMPRESSED:
        check_installed(compressed=True)
    try:
        with warnings.catch_warnings(), panics_as_errors() if data[COMPRESSION] > UNCOMPRESSED else nullcontext():
            warnings.simplefilter("ignore")  # of unusual headers
            las = laspy.read(BytesIO(data))
    except laspy.LaspyException as error:
        raise UserError("it is damaged, or of a version that laspy does not know: get the file again") from error
    if len(las.points) != las.header.point_count:
        raise UserError(
            f"it is cut off: {len(las.points)} of its {las.header.point_count} points are there: get the file again"
        )
    return points_cloud(las, without_octree(las.header))


def points_cloud(las: Any, notes: tuple[str, ...]) -> Cloud:
    """Return the cloud of a `laspy.LasData`, with all dimensions in the file's order."""
    names = [name for name in las.point_format.dimension_names if name not in ("X", "Y", "Z", "x", "y", "z")]
    columns = {name: native(np.array(las[name])) for name in names}
    about = {"las": {"header": las.header}, "notes": notes}
    return Cloud(np.array(las.xyz, np.float64, order="C"), columns, about)


def without_octree(header: Any) -> tuple[str, ...]:
    """Remove COPC's records from a header, since they hold for the points in the file alone; return a note on it."""
    removed = 0
    for records in (header.vlrs, header.evlrs):
        for record in [one for one in records or () if one.user_id.lower() == COPC]:
            records.remove(record)
            removed += 1
    if not removed:
        return ()
    return (f"it is a COPC: the octree in {removed} of its records was left out, and .laz is written as plain LAZ",)


def check_counts(data: Data, *, whole: bool = True) -> None:
    """Check that the records and points that the header claims fit into the file; laspy would search for each.

    Args:
        data: the file, or a memory map of it.
        whole: whether all points will be in memory.

    Raises:
        UserError: they do not fit, or compressed points are damaged.
    """
    if len(data) < max(HEADER, _integer(data, 94, 2)):
        raise UserError("it is cut off in its header")
    numbers = np.frombuffer(data, "<f8", 6, 131)
    if not (np.isfinite(numbers).all() and (np.abs(numbers[:3]) >= SMALLEST).all()):
        raise UserError(
            f"its header has the scales {numbers[:3].tolist()} and the offsets {numbers[3:].tolist()}, by which no "
            f"coordinates can be computed: it is damaged"
        )
    extended = data[25] >= 4  # version 1.4 has extended records after the points, and a point count of 64 bits
    claimed = _integer(data, 100, 4) * RECORD + (_integer(data, 243, 4) * LONG_RECORD if extended else 0)
    if claimed > len(data):
        raise UserError("its header claims more records than the file has room for: it is cut off or damaged")
    count, size, compressed = (
        _integer(data, 247, 8) if extended else _integer(data, 107, 4),
        _integer(data, 105, 2),
        data[COMPRESSION] > UNCOMPRESSED,
    )
    there = max(0, len(data) - _integer(data, 96, 4)) // max(size, 1)
    if there < count and not compressed:
        raise UserError(f"it is cut off: {there} of its {count} points are there: get the file again")
    if compressed:
        if whole:
            check_inflated(len(data), count * size)
        check_chunks(data, _integer(data, 96, 4), size, count)


def _integer(data: Data, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")


def write_las(cloud: Cloud) -> bytes:
    """Write a cloud as LAS, with the scales, offsets and point format that it was read with, if any.

    A column is written to the dimension of its name if that can represent its values, and to an extra dimension
    otherwise. 8-bit colours are scaled to 16 bits, as the format requires.

    Raises:
        UserError: laspy is not installed, or a coordinate is out of the range of scale and offset.
    """
    return _write(cloud, compress=False)


def write_laz(cloud: Cloud) -> bytes:
    """Write a cloud as LAZ, which is compressed LAS; see `write_las`."""
    return _write(cloud, compress=True)


def check_installed(*, compressed: bool) -> None:
    """Check that laspy is installed, and for LAZ its compressor.

    Raises:
        UserError: it is not; the message names the package to install.
    """
    available = imported("laspy", USER).LazBackend.detect_available()
    if compressed and not available:
        require({"lazrs": "the format LAZ"})


def _write(cloud: Cloud, *, compress: bool) -> bytes:
    las = las_data(cloud)
    file = BytesIO()
    with _as_user_errors(las.header):
        las.write(file, do_compress=compress)
    return file.getvalue()


@contextmanager
def _as_user_errors(header: Any) -> Iterator[None]:
    laspy = imported("laspy", USER)
    try:
        yield
    except (laspy.LaspyException, OverflowError, ValueError) as error:
        raise UserError(
            f"a LAS file of version {header.version} and point format {header.point_format.id} cannot hold this cloud: "
            f"write a .ply file"
        ) from error


def las_data(cloud: Cloud) -> Any:
    """Return a cloud as `laspy.LasData`, with the header of the file; see `write_las`.

    Raises:
        UserError: as `write_las`.
    """
    laspy = imported("laspy", USER)
    known = cloud.about.get("las", {}).get("header")
    colours = _colours_in_16_bits(cloud.columns)
    header = copy.deepcopy(known) if known is not None else _header(laspy, cloud.points, bool(colours))
    standard = set(header.point_format.dimension_names)
    columns = {name: column for name, column in cloud.columns.items() if name in standard}
    flat = spread({name: column for name, column in cloud.columns.items() if name not in standard}, rest=True)
    columns |= {unused(name, columns): column for name, column in flat.items()}
    if known is None:
        columns |= colours
    header.remove_extra_dims([name for name in header.point_format.extra_dimension_names if name not in columns])
    dimensions = {_dimension(header, laspy, name, column, columns): column for name, column in columns.items()}
    stored = np.rint((cloud.points - header.offsets) / header.scales)
    if np.abs(stored).max() > RANGE:
        raise UserError(
            f"the coordinates reach {np.abs(cloud.points).max():g}, beyond what the scales {list(header.scales)} and "
            f"offsets {list(header.offsets)} of the original file allow: write a .ply file"
        )
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header))
    las.X, las.Y, las.Z = stored.astype(np.int32).T
    with _as_user_errors(header):
        for name, column in dimensions.items():
            las[name] = _storable(column)
    return las


def _header(laspy: Any, points: np.ndarray, coloured: bool) -> Any:
    header = laspy.LasHeader(version="1.4", point_format=7 if coloured else 6)
    lowest, span = points.min(axis=0), float(np.ptp(points, axis=0).max())
    header.offsets = np.floor(lowest) if span >= 1 or not span else lowest
    extent = float((points - header.offsets).max()) or 1.0
    scale = 10.0 ** np.ceil(np.log10(extent / RANGE))
    if not scale >= SMALLEST:
        raise UserError(f"the cloud is only {span:g} across, too small for the scales of LAS: write a .ply file")
    header.scales = np.full(3, scale)
    return header


def _colours_in_16_bits(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert red, green and blue to 16 bits; return nothing if one is missing or its range is not known."""
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


def _dimension(header: Any, laspy: Any, name: str, column: np.ndarray, taken: dict[str, np.ndarray]) -> str:
    """Return the dimension for a column: the one of its name if it fits, otherwise a new one."""
    point_format = header.point_format
    dimensions = {each.name: each for each in point_format.dimensions}
    if name in dimensions:
        if name in point_format.extra_dimension_names or _fits(column, dimensions[name]):
            return name
        name = unused(name, [*dimensions, *taken])
    if len(name.encode()) > NAME_LENGTH:
        raise UserError(f"the column name '{name}' is longer than the {NAME_LENGTH} bytes that LAS allows: rename it")
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
