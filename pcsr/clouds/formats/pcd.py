"""PCD, the format of the Point Cloud Library: text, binary and compressed, by pypcd4 (extra `[pcd]`)."""

import re
import warnings
from io import BytesIO, StringIO
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import NORMALS, native, spread, unused
from pcsr.clouds.formats.colours import in_bytes, unpacked
from pcsr.clouds.formats.digits import cast_column, load_rows, words
from pcsr.clouds.formats.pcd_header import VIEWPOINT, Header, parse
from pcsr.clouds.formats.precision import coordinates
from pcsr.errors import UserError
from pcsr.extras import imported, require

USER = "the format PCD"
"""Feature that needs pypcd4, for the message if it is not installed."""


def read(data: bytes) -> Cloud:
    """Read all fields. `rgb` and `rgba` are unpacked to red, green, blue (and alpha); `normal_x` is renamed to nx.

    Raises:
        UserError: a coordinate is missing, the file is cut off, or the extra `[pcd]` is not installed.
    """
    check_installed()
    header = parse(data)
    if not header.points:
        raise UserError("it holds no points")
    table = _text(data, header) if header.encoding == "ascii" else _binary(data, header)
    about: dict[str, Any] = {"encoding": header.encoding, "viewpoint": header.viewpoint, "packed": []}
    columns: dict[str, np.ndarray] = {}
    for one, column in zip(header.fields, table, strict=True):
        name, packed = one.name, one.name.lower() in ("rgb", "rgba")
        if name in ("", "x", "y", "z"):
            continue
        if packed and column.dtype.itemsize == 4 and column.ndim == 1:
            about["packed"] = [name.lower(), column.dtype.str[1:]]
            colours = unpacked(column)
            colours = colours if name.lower() == "rgba" else colours[:, :3]
            for colour, part in zip(("red", "green", "blue", "alpha"), colours.T, strict=False):
                columns[unused(colour, columns)] = np.ascontiguousarray(part)
        else:
            columns[unused(name.replace("normal_", "n") if name[:-1] == "normal_" else name, columns)] = column
    by_name = {one.name: column for one, column in zip(header.fields, table, strict=True)}
    # Each coordinate is converted by itself, since the table's types may differ.
    points = np.stack([np.asarray(by_name[axis], np.float64) for axis in "xyz"], axis=-1)
    about["coordinates"] = by_name["x"].dtype.str[1:]
    return Cloud(points, columns, {"pcd": about, "notes": tuple(header.notes)})


def check_installed() -> None:
    """Check that pypcd4 is installed.

    Raises:
        UserError: it is not; the message names the extra.
    """
    require({"pypcd4": USER})


def _binary(data: bytes, header: Header) -> list[np.ndarray]:
    """Return the numbers of each field, (n,) or (n, count).

    Raises:
        UserError: the compressed data are damaged.
    """
    pypcd4 = imported("pypcd4.pypcd4", USER)
    size = sum(int(one.type[1:]) * one.count for one in header.fields)
    used = header.points * size
    # A header of the newest version, with unique names, is all that pypcd4 reads.
    meta = pypcd4.MetaData(
        fields=[f"f{number}" for number in range(len(header.fields))],
        size=[int(one.type[1:]) for one in header.fields],
        type=[one.type[0].upper() for one in header.fields],
        count=[one.count for one in header.fields],
        width=header.points,
        points=header.points,
        data=header.encoding,
    )
    rest = data[header.end : header.end + used] if header.encoding == "binary" else data[header.end :]
    try:
        table = pypcd4.PointCloud.from_fileobj(BytesIO(meta.compose_header().encode() + rest)).pc_data
    except (ValueError, RuntimeError, TypeError) as error:
        raise UserError("its compressed data are damaged: get the file again") from error
    columns = []
    for number, one in enumerate(header.fields):
        parts = [f"f{number}"] if one.count == 1 else [f"f{number}__{i:04d}" for i in range(one.count)]
        columns.append(
            native(table[parts[0]]) if one.count == 1 else np.stack([table[part] for part in parts], axis=-1)
        )
    return columns


def _text(data: bytes, header: Header) -> list[np.ndarray]:
    """Return the numbers of each field, (n,) or (n, count).

    Raises:
        UserError: a row has too few or too many numbers, or a word is no number.
    """
    text = data[header.end :].decode("latin-1")
    width = sum(one.count for one in header.fields)
    kinds = [(f"{number}", one.type, (one.count,)) for number, one in enumerate(header.fields)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of numbers such as 1.5 that are truncated
            table = np.loadtxt(StringIO(text), np.dtype(kinds), comments=None, ndmin=1, max_rows=header.points)
        blocks = [table[f"{number}"] for number in range(len(header.fields))]
    except (ValueError, DeprecationWarning):
        rows = load_rows(text, header.points)
        if rows.shape[1] != width:
            raise UserError(f"its points have {rows.shape[1]} numbers each, and its header claims {width}") from None
        blocks, at = [], 0
        for one in header.fields:
            blocks.append(cast_column(rows[:, at : at + one.count], np.dtype(one.type), one.name))
            at += one.count
    return [
        np.ascontiguousarray(block[:, 0] if one.count == 1 else block)
        for one, block in zip(header.fields, blocks, strict=True)
    ]


def write(cloud: Cloud) -> bytes:
    """Write a cloud as PCD, in the encoding that it was read in, or binary; 8-bit colours are packed.

    Coordinates are written in single precision, which PCL and Open3D need, if they were read so and lose less than a
    millionth of the extent, otherwise in double precision.
    Organised clouds are written with HEIGHT 1.

    Raises:
        UserError: the format cannot hold a column, or the extra `[pcd]` is not installed.
    """
    pypcd4 = imported("pypcd4.pypcd4", USER)
    about = cloud.about.get("pcd", {})
    encoding = about.get("encoding", "binary")
    fields = dict(zip("xyz", coordinates(cloud, prefer_single=True).T, strict=True))
    flat_columns = spread(cloud.columns, rest=False)
    fields |= _packed(_named(flat_columns if about else in_bytes(flat_columns)), about.get("packed", ["", "f4"]))
    fields = {name: _storable(name, column) for name, column in fields.items()}
    meta = pypcd4.MetaData.model_validate(
        {
            "fields": list(fields),
            "size": [column.dtype.itemsize for column in fields.values()],
            "type": [column.dtype.kind.upper() for column in fields.values()],
            "count": [column.shape[1] if column.ndim == 2 else 1 for column in fields.values()],
            "width": len(cloud),
            "points": len(cloud),
            "viewpoint": about.get("viewpoint", VIEWPOINT),
        }
    )
    flat = [part for column in fields.values() for part in (column.T if column.ndim == 2 else [column])]
    table = np.zeros(len(cloud), meta.build_dtype())
    for name, part in zip(table.dtype.names or (), flat, strict=True):
        table[name] = part
    file = BytesIO()
    if encoding == "ascii":
        file.write(meta.compose_header(data=pypcd4.Encoding.ASCII).encode())
        file.writelines((" ".join(row) + "\n").encode() for row in zip(*map(words, flat), strict=True))
    else:
        pypcd4.PointCloud(meta, table).save(file, pypcd4.Encoding(encoding))
    return file.getvalue()


def _named(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rename columns to names that a header can hold. A field `_` would be padding."""
    named: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        word = re.sub(r"[^\w.-]", "_", name)
        named[unused(word if word.strip("_") else "column", [*named, "x", "y", "z"])] = column
    return named


def _packed(columns: dict[str, np.ndarray], packed: list[str]) -> dict[str, np.ndarray]:
    """Return the fields of a file.

    Args:
        columns: columns of the cloud.
        packed: name and type of the field with packed colours; empty if colours are written as separate fields.
    """
    colours = [columns[name] for name in ("red", "green", "blue", "alpha") if name in columns]
    in_bytes = all(colour.dtype == np.uint8 and colour.ndim == 1 for colour in colours)
    pack = bool(packed) and in_bytes and {"red", "green", "blue"} <= columns.keys()
    fields: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if pack and name in ("green", "blue", "alpha"):
            continue
        if pack and name == "red":
            shifted = zip(colours, (16, 8, 0, 24), strict=False)
            bits = np.bitwise_or.reduce([colour.astype(np.uint32) << shift for colour, shift in shifted])
            # With alpha many of the bit patterns would be NaN as floats, which text cannot distinguish.
            kind = "u4" if len(colours) == 4 else packed[1]
            fields["rgba" if len(colours) == 4 else "rgb"] = bits.view(np.float32) if kind == "f4" else bits
        elif name in NORMALS and columns.keys() >= set(NORMALS):
            fields[f"normal_{name[1]}"] = column
        else:
            fields[name] = column
    return fields


def _storable(name: str, column: np.ndarray) -> np.ndarray:
    if column.ndim == 2 and column.shape[1] == 0:
        raise UserError(f"column '{name}' has no numbers: a .pcd holds no such field")
    if column.dtype.kind == "b":
        return column.astype(np.uint8)
    if column.dtype.kind == "f" and column.dtype.itemsize not in (4, 8):
        return column.astype(np.float32 if column.dtype.itemsize < 4 else np.float64)
    return column
