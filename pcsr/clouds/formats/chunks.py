"""Reading of cloud files in chunks, so that a file of any size needs little memory."""

import mmap
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import arrays, las, ply
from pcsr.clouds.formats.beginnings import check_start
from pcsr.clouds.formats.format_table import format_of
from pcsr.clouds.formats.laz import panics_as_errors
from pcsr.clouds.formats.ply_header import HEADER, ORDERS, TYPES, Element, Header, parse, vertices
from pcsr.clouds.npy import read_header
from pcsr.errors import UserError
from pcsr.extras import imported
from pcsr.inputs import check_file

CHUNKED = (".ply", ".npy", ".las", ".laz")
"""Formats that can be read and written in chunks."""
CHUNK = 1 << 18
"""Points of a chunk."""
REMEDY = "convert it to LAS, LAZ, binary PLY or NPY"


class ChunkedCloud(ABC):
    """Cloud in a file, which is read chunk by chunk.

    Args:
        path: path of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.count = 0
        """Number of points."""

    @abstractmethod
    def read(self, size: int) -> Iterator[Cloud]:
        """Yield the cloud in chunks of at most `size` points, in the order of the file."""

    def chunks(self, size: int = CHUNK) -> Iterator[Cloud]:
        """Yield the cloud in chunks, in the order of the file.

        Args:
            size: largest number of points of a chunk.

        Raises:
            UserError: the file is damaged.
        """
        found = 0
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for chunk in self.read(size):
                    found += len(chunk)
                    yield chunk
        except UserError as error:
            raise UserError(f"{self.path}: {error}") from error
        if found != self.count:
            raise UserError(
                f"{self.path}: it is cut off: {found} of its {self.count} points are there: get the file again"
            )


def open_chunks(path: Path, suffix: str | None = None) -> ChunkedCloud:
    """Open a cloud file for reading in chunks.

    Args:
        path: path of the file.
        suffix: suffix or name of the format; by default that of the path.

    Raises:
        UserError: the format cannot be read in chunks, or the file is missing, cut off or damaged.
    """
    kind = format_of(path, suffix)
    if kind not in CHUNKED:
        raise UserError(f"{path}: a {kind} file cannot be read in parts: {REMEDY}")
    check_file(path)
    with path.open("rb") as file:
        check_start(file.read(HEADER), kind, str(path))
    readers: dict[str, type[ChunkedCloud]] = {".ply": _Ply, ".npy": _Npy, ".las": _Las, ".laz": _Las}
    try:
        return readers[kind](path)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


class _Ply(ChunkedCloud):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            self.header: Header = parse(file.read(HEADER))
        wanted, self.notes = vertices(self.header)
        self.element: Element = self.header.elements[wanted]
        self.count = self.element.count
        if not self.count:
            raise UserError("it holds no points")
        before = [each for each in self.header.elements[:wanted] if each.count]
        if self.header.encoding == "ascii" or any(
            each.length for element in [*before, self.element] for each in element.properties
        ):
            what = "is text" if self.header.encoding == "ascii" else "has lists"
            raise UserError(f"a PLY that {what} cannot be read in parts: {REMEDY}, without lists")
        self.start = self.header.end + sum(each.count * self._row(each).itemsize for each in before)
        self.row = self._row(self.element)
        there = max(0, path.stat().st_size - self.start) // max(1, self.row.itemsize)
        if there < self.count:
            raise UserError(f"it is cut off: {there} of its {self.count} points are there: get the file again")

    def _row(self, element: Element) -> "np.dtype[np.void]":
        order = ORDERS[self.header.encoding]
        return np.dtype([(f"{number}", order + TYPES[each.type]) for number, each in enumerate(element.properties)])

    def read(self, size: int) -> Iterator[Cloud]:
        with self.path.open("rb") as file:
            file.seek(self.start)
            for at in range(0, self.count, size):
                rows = np.fromfile(file, self.row, min(size, self.count - at))
                table = {each.name: rows[f"{number}"] for number, each in enumerate(self.element.properties)}
                yield ply.vertex_cloud(table, self.header.encoding, self.header.comments, self.element, self.notes)


class _Npy(ChunkedCloud):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            self.shape, self.fortran, self.dtype = read_header(file)
            self.start = file.tell()
        if self.dtype.hasobject or self.dtype.kind not in "iuf" or len(self.shape) != 2:
            raise UserError(f"it holds {self.dtype} of shape {self.shape}: points are real numbers of shape (n, 3)")
        self.count = self.shape[0]
        size = self.shape[0] * self.shape[1] * self.dtype.itemsize
        if path.stat().st_size - self.start < size:
            raise UserError(f"it is cut off: its header claims {size} bytes of numbers: get the file again")
        arrays.rows_cloud(np.zeros((min(1, self.count), self.shape[1]), self.dtype))  # checks the shape

    def read(self, size: int) -> Iterator[Cloud]:
        width = self.shape[1]
        with self.path.open("rb") as file:
            for at in range(0, self.count, size):
                count = min(size, self.count - at)
                if self.fortran:
                    columns = []
                    for column in range(width):
                        file.seek(self.start + (column * self.count + at) * self.dtype.itemsize)
                        columns.append(np.fromfile(file, self.dtype, count))
                    yield arrays.rows_cloud(np.column_stack(columns))
                else:
                    file.seek(self.start + at * width * self.dtype.itemsize)
                    yield arrays.rows_cloud(np.fromfile(file, self.dtype, count * width).reshape(-1, width))


class _MappedFile(mmap.mmap):
    def seek(self, *args: Any) -> int:  # type: ignore[override]
        """Seek, and return the position as files do; before Python 3.13 `mmap` returns None."""
        super().seek(*args)
        return self.tell()


class _Las(ChunkedCloud):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            data = _MappedFile(file.fileno(), 0, access=mmap.ACCESS_READ)
            if len(data) < las.HEADER:
                raise UserError("it is cut off in its header")
            self.compressed = data[las.COMPRESSION] > las.UNCOMPRESSED
            las.check_installed(compressed=self.compressed)
            las.check_counts(data, whole=False)
        with self._opened() as reader:
            self.count = reader.header.point_count
            self.header = reader.header
        self.notes = las.without_octree(self.header)
        if not self.count:
            raise UserError("it holds no points")

    def _opened(self) -> Any:
        laspy = imported("laspy", las.USER)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of unusual headers
                return laspy.open(self.path)
        except laspy.LaspyException as error:
            raise UserError("it is damaged, or of a version that laspy does not know: get the file again") from error

    def read(self, size: int) -> Iterator[Cloud]:
        laspy = imported("laspy", las.USER)
        with self._opened() as reader:
            for _ in range(0, self.count, size):
                try:
                    with panics_as_errors() if self.compressed else nullcontext():
                        points = reader.read_points(size)
                except laspy.LaspyException as error:
                    raise UserError("its points are damaged: get the file again") from error
                yield las.points_cloud(laspy.LasData(self.header, points), self.notes)
