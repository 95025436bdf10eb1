"""PCD, the format of the Point Cloud Library: text, binary and compressed, by pypcd4 (extra `[pcd]`)."""

import re
from io import BytesIO
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import NORMALS, native, spread, unused
from pcsr.clouds.formats.digits import check_lines, words
from pcsr.errors import UserError
from pcsr.extras import imported, require
from pcsr.limits import check_inflated

USER = "the format PCD"
"""Feature that needs pypcd4, for the message if it is not installed."""
PADDING = "#$%&~~"
"""Prefix that pypcd4 gives to the names of padding fields."""
HEADER = 1 << 16
"""Largest size of a header in bytes."""
KINDS = {*((kind, size) for kind in "IU" for size in (1, 2, 4, 8)), ("F", 4), ("F", 8)}
"""Types of fields and their sizes in bytes."""
DIGITS = 20
"""Numbers in a header must have fewer digits than this."""
WIDEST = 10_000
"""Most numbers of a point. pypcd4 would create a name for each number that a damaged header claims."""


def read(data: bytes) -> Cloud:
    """Read all fields. `rgb` and `rgba` are unpacked to red, green, blue (and alpha); `normal_x` is renamed to nx.

    Raises:
        UserError: a coordinate is missing, the file is cut off, or the extra `[pcd]` is not installed.
    """
    pypcd4 = imported("pypcd4.pypcd4", USER)
    _check_header(data)
    cloud = pypcd4.PointCloud.from_fileobj(BytesIO(data))
    meta = cloud.metadata
    missing = [name for name in "xyz" if name not in cloud.fields]
    if missing:
        raise UserError(f"it has no field {', '.join(missing)}, only {', '.join(cloud.fields)}")
    table = np.atleast_1d(cloud.pc_data)
    if len(table) != cloud.points:
        raise UserError(f"it is cut off: {len(table)} of its {cloud.points} points are there: get the file again")
    about: dict[str, Any] = {"encoding": meta.data.value, "viewpoint": tuple(meta.viewpoint), "packed": []}
    columns: dict[str, np.ndarray] = {}
    for name, count in zip(meta.fields, meta.count, strict=True):
        if name.startswith(PADDING) or name in ("x", "y", "z"):
            continue
        if count > 1:
            column = np.stack([table[f"{name}__{i:04d}"] for i in range(count)], axis=-1)
        else:
            column = native(table[name])
        if name in ("rgb", "rgba") and column.dtype.itemsize == 4 and count == 1:
            about["packed"] = [name, column.dtype.str[1:]]
            colours = _unpacked(column)
            colours = colours if name == "rgba" else colours[:, :3]
            for colour, part in zip(("red", "green", "blue", "alpha"), colours.T, strict=False):
                columns[unused(colour, columns)] = np.ascontiguousarray(part)
        else:
            columns[unused(name.replace("normal_", "n") if name[:-1] == "normal_" else name, columns)] = column
    # Each coordinate is converted by itself, since the table's types may differ.
    points = np.stack([np.asarray(table[name], np.float64) for name in "xyz"], axis=-1)
    about["coordinates"] = table["x"].dtype.str[1:]
    return Cloud(points, columns, {"pcd": about})


def check_installed() -> None:
    """Check that pypcd4 is installed.

    Raises:
        UserError: it is not; the message names the extra.
    """
    require({"pypcd4": USER})


def _check_header(data: bytes) -> None:
    """Check that the header describes a cloud that fits into the file, which pypcd4 does not check.

    Raises:
        UserError: it does not.
    """
    end = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data[:HEADER], re.MULTILINE)
    if not end:
        raise UserError(
            f"it cannot be read as a .pcd file: its header has no line DATA within {HEADER} bytes: get the file again"
        )
    lines = data[: end.start()].decode("utf-8", "replace").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines) if len(words) > 1}
    fields = header.get("FIELDS", [])
    if not fields:
        raise UserError("its header has no line FIELDS")
    sizes, counts = (_integers(header, key, len(fields)) for key in ("SIZE", "COUNT"))
    if len(header.get("TYPE", [])) != len(fields) or not set(zip(header["TYPE"], sizes, strict=True)) <= KINDS:
        raise UserError("its TYPE and SIZE must be I or U with 1, 2, 4 or 8, or F with 4 or 8, for each field")
    if sum(counts) > WIDEST:
        raise UserError(f"its COUNT is {' '.join(header['COUNT'])[:80]}: {WIDEST} numbers for each point are the most")
    (points,) = _integers(header, "POINTS", 1)
    _integers(header, "WIDTH", 1)
    _integers(header, "HEIGHT", 1)
    rest, encoding = data[end.end() :], end[1].decode()
    whole = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if encoding == "ascii":
        check_lines(data, end.end())
    elif encoding == "binary":
        there = len(rest) * points // whole if whole else 0
        if there < points:
            raise UserError(f"it is cut off: {there} of its {points} points are there: get the file again")
    elif encoding == "binary_compressed":
        packed, unpacked = (int.from_bytes(rest[at : at + 4], "little") for at in (0, 4))
        if len(rest) < 8 + packed:
            raise UserError(
                f"it is cut off: {max(0, len(rest) - 8)} of {packed} compressed bytes are there: get the file again"
            )
        if unpacked != whole:
            raise UserError(
                f"its compressed data claim {unpacked} bytes, and its {points} points take {whole}: it is damaged"
            )
        check_inflated(packed, unpacked)
    else:
        raise UserError(f"its DATA is '{encoding[:80]}': ascii, binary and binary_compressed are known")


def _integers(header: dict[str, list[str]], key: str, count: int) -> list[int]:
    """Return the integers of a line of the header; COUNT and HEIGHT are 1 by default."""
    words = header.get(key, ["1"] * count if key in ("COUNT", "HEIGHT") else [])
    if len(words) < count or not all(word.isdecimal() and len(word) < DIGITS for word in words[:count]):
        needed = "an integer is" if count == 1 else f"{count} integers are"
        raise UserError(f"its {key} is '{' '.join(words)[:80]}': {needed} needed")
    return [int(word) for word in words[:count]]


def _unpacked(packed: np.ndarray) -> np.ndarray:
    """Unpack red, green, blue and alpha from the bytes of 32-bit numbers 0xAARRGGBB."""
    bits = packed.view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.uint32)
    return np.stack([(bits >> shift).astype(np.uint8) for shift in (16, 8, 0, 24)], axis=-1)


def write(cloud: Cloud) -> bytes:
    """Write a cloud as PCD, in the encoding that it was read in, or binary; 8-bit colours are packed.

    Coordinates are written in single precision if they were read so and need no more, otherwise in double precision.
    Organised clouds are written with HEIGHT 1.

    Raises:
        UserError: the format cannot hold a column, or the extra `[pcd]` is not installed.
    """
    pypcd4 = imported("pypcd4.pypcd4", USER)
    about = cloud.about.get("pcd", {})
    encoding = about.get("encoding", "binary")
    with np.errstate(over="ignore"):
        single = cloud.points.astype(np.float32)
    points = single if about.get("coordinates") == "f4" and (single == cloud.points).all() else cloud.points
    fields = dict(zip("xyz", points.T, strict=True))
    fields |= _packed(_named(cloud.columns), about.get("packed", ["", "f4"]))
    fields = {name: _storable(name, column) for name, column in fields.items()}
    meta = pypcd4.MetaData.model_validate(
        {
            "fields": list(fields),
            "size": [column.dtype.itemsize for column in fields.values()],
            "type": [column.dtype.kind.upper() for column in fields.values()],
            "count": [column.shape[1] if column.ndim == 2 else 1 for column in fields.values()],
            "width": len(cloud),
            "points": len(cloud),
            "viewpoint": about.get("viewpoint", (0, 0, 0, 1, 0, 0, 0)),
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
    for name, column in spread(columns, rest=False).items():
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
