"""Writing of cloud files in parts: rows are encoded part by part, and joined to a file at the end."""

import copy
import datetime
from abc import ABC, abstractmethod
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import arrays, las, ply_writing
from pcsr.clouds.formats.chunks import CHUNKED
from pcsr.errors import RunError, UserError
from pcsr.extras import imported

Rows = UInt8[np.ndarray, "n size"]
"""Encoded rows: their bytes."""


class RowWriter(ABC):
    """Encoder of the rows of one file. All parts have the layout that the whole cloud would have.

    The layout depends on values: whether coordinates are single, whether 16-bit colours are in the range of 8 bits,
    whether a float column fits into an integer dimension. `examples` has rows with the values that decide. They are
    encoded together with each part, and then removed.

    Args:
        examples: rows with the extreme values of each column and of the coordinates, and any that are not whole.
        kind: suffix of the format.
    """

    def __init__(self, examples: Cloud, kind: str) -> None:
        self.examples = examples
        self.kind = kind
        self.layout, rows = self.encoded(examples)
        self.row_size = rows.dtype.itemsize * (rows.shape[1] if rows.ndim == 2 else 1)
        """Bytes of a row."""

    @abstractmethod
    def encoded(self, cloud: Cloud) -> tuple[Any, np.ndarray]:
        """Return the layout of a cloud's rows, and the rows."""

    @abstractmethod
    def write(self, path: Path, count: int, parts: Iterable[Rows]) -> None:
        """Write a file of `count` rows, which come in parts."""

    def rows(self, cloud: Cloud) -> Rows:
        """Encode a part of the cloud.

        Raises:
            RunError: its values need another layout than those of `examples`.
        """
        first = len(self.examples)
        layout, rows = self.encoded(_joined(self.examples, cloud))
        if layout != self.layout:
            raise RunError(
                f"the new points do not fit into the rows of the {self.kind} file, which follow from the values of the "
                f"given points: write a .ply file"
            )
        return np.ascontiguousarray(rows[first:]).view(np.uint8).reshape(len(cloud), self.row_size)


def row_writer(kind: str, examples: Cloud, date: datetime.date) -> RowWriter:
    """Return the encoder of a format.

    Args:
        kind: suffix of the format.
        examples: as of `RowWriter`.
        date: day that is written into the file where its format has one.

    Raises:
        UserError: the format cannot be written in parts, or cannot hold the cloud.
    """
    if kind == ".ply":
        return _PlyRows(examples, kind)
    if kind == ".npy":
        return _NpyRows(examples, kind)
    if kind in (".las", ".laz"):
        return _LasRows(examples, kind, date)
    raise UserError(f"a {kind} file cannot be written in parts: choose one of {', '.join(CHUNKED)} as OUT")


def _joined(first: Cloud, second: Cloud) -> Cloud:
    columns = {name: np.concatenate([column, second.columns[name]]) for name, column in first.columns.items()}
    return Cloud(np.concatenate([first.points, second.points]), columns, second.about)


class _PlyRows(RowWriter):
    def encoded(self, cloud: Cloud) -> tuple[Any, np.ndarray]:
        properties, rows = ply_writing.table(cloud)
        return properties, rows

    def write(self, path: Path, count: int, parts: Iterable[Rows]) -> None:
        _write_parts(path, ply_writing.header(self.examples, self.layout, count), parts)


class _NpyRows(RowWriter):
    def encoded(self, cloud: Cloud) -> tuple[Any, np.ndarray]:
        rows = arrays.table(cloud)
        return (rows.dtype, rows.shape[1]), rows

    def write(self, path: Path, count: int, parts: Iterable[Rows]) -> None:
        dtype, width = self.layout
        header = BytesIO()
        about = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": (count, width)}
        np.lib.format.write_array_header_1_0(header, about)
        _write_parts(path, header.getvalue(), parts)


class _LasRows(RowWriter):
    def __init__(self, examples: Cloud, kind: str, date: datetime.date) -> None:
        self.date = date
        super().__init__(examples, kind)

    def encoded(self, cloud: Cloud) -> tuple[Any, np.ndarray]:
        points = las.las_data(cloud).points
        return (points.array.dtype, points.scales.tolist(), points.offsets.tolist()), points.array

    def write(self, path: Path, count: int, parts: Iterable[Rows]) -> None:
        laspy = imported("laspy", las.USER)
        like = las.las_data(self.examples)
        header = copy.deepcopy(like.header)
        if "las" not in self.examples.about:
            header.creation_date = self.date
        if count > header.max_point_count():
            raise UserError(
                f"a LAS file of version {header.version} holds {header.max_point_count()} points, and {count} would be "
                f"written: write a .ply file"
            )
        with (
            path.open("wb+") as file,
            laspy.LasWriter(file, header, do_compress=self.kind == ".laz", closefd=False) as writer,
        ):
            for part in parts:
                array = part.reshape(-1).view(like.points.array.dtype)
                writer.write_points(
                    laspy.ScaleAwarePointRecord(array, header.point_format, header.scales, header.offsets)
                )
            if header.version.minor >= 4 and header.evlrs is not None:
                writer.write_evlrs(header.evlrs)


def _write_parts(path: Path, header: bytes, parts: Iterable[Rows]) -> None:
    with path.open("wb") as file:
        file.write(header)
        for part in parts:
            file.write(part.data)
