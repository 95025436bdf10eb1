"""PCD, as the Point Cloud Library has it: text, binary and compressed; packed colours are unpacked."""

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
"""What needs pypcd4, in a message to who hasn't got it."""
PADDING = "#$%&~~"
"""What pypcd4 calls fields that only fill up space."""
HEADER = 1 << 16
"""A header ends within so many bytes."""
KINDS = {*((kind, size) for kind in "IU" for size in (1, 2, 4, 8)), ("F", 4), ("F", 8)}
"""Types and sizes of fields."""
DIGITS = 20
"""No header has a number of so many."""
WIDEST = 10_000
"""A damaged header may claim billions of numbers for each point, and pypcd4 would name each."""


def read(data: bytes) -> Cloud:
    """All fields. `rgb` and `rgba` become red, green, blue (and alpha), `normal_x` becomes nx.

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
        raise UserError(f"it is cut off: {len(table)} of its {cloud.points} points are there")
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
    # One by one: what is beside them may be of a type that holds no doubles.
    points = np.stack([np.asarray(table[name], np.float64) for name in "xyz"], axis=-1)
    about["coordinates"] = table["x"].dtype.str[1:]
    return Cloud(points, columns, {"pcd": about})


def check_installed() -> None:
    """Check that pypcd4 is there.

    Raises:
        UserError: it is not; the message names the extra.
    """
    require({"pypcd4": USER})


def _check_header(data: bytes) -> None:
    """Refuse a header that says no cloud, or one that the file has no room for: pypcd4 would believe it.

    Raises:
        UserError: it does.
    """
    end = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data[:HEADER], re.MULTILINE)
    if not end:
        raise UserError(
            f"it cannot be read as a .pcd file: its header has no line DATA within {HEADER} bytes: it is cut off"
        )
    lines = data[: end.start()].decode("utf-8", "replace").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines) if len(words) > 1}
    fields = header.get("FIELDS", [])
    if not fields:
        raise UserError("its header has no line FIELDS")
    sizes, counts = (_wholes(header, key, len(fields)) for key in ("SIZE", "COUNT"))
    if len(header.get("TYPE", [])) != len(fields) or not set(zip(header["TYPE"], sizes, strict=True)) <= KINDS:
        raise UserError("its TYPE and SIZE must be one of I and U with 1, 2, 4, 8 and F with 4, 8 for each field")
    if sum(counts) > WIDEST:
        raise UserError(f"its COUNT is {' '.join(header['COUNT'])[:80]}: {WIDEST} numbers for each point are the most")
    (points,) = _wholes(header, "POINTS", 1)
    _wholes(header, "WIDTH", 1)
    _wholes(header, "HEIGHT", 1)
    rest, encoding = data[end.end() :], end[1].decode()
    whole = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if encoding == "ascii":
        check_lines(data, end.end())
    elif encoding == "binary":
        there = len(rest) * points // whole if whole else 0
        if there < points:
            raise UserError(f"it is cut off: {there} of its {points} points are there")
    elif encoding == "binary_compressed":
        packed, unpacked = (int.from_bytes(rest[at : at + 4], "little") for at in (0, 4))
        if len(rest) < 8 + packed:
            raise UserError(f"it is cut off: {max(0, len(rest) - 8)} of {packed} compressed bytes are there")
        if unpacked != whole:
            raise UserError(f"its {packed} compressed bytes become {unpacked}, and its {points} points take {whole}")
        check_inflated(packed, unpacked)
    else:
        raise UserError(f"its DATA is '{encoding[:80]}': ascii, binary and binary_compressed are known")


def _wholes(header: dict[str, list[str]], key: str, count: int) -> list[int]:
    """The whole numbers of a line of the header."""
    words = header.get(key, ["1"] * count if key in ("COUNT", "HEIGHT") else [])
    if len(words) < count or not all(word.isdecimal() and len(word) < DIGITS for word in words[:count]):
        raise UserError(f"its {key} is '{' '.join(words)[:80]}': {count} whole numbers are needed")
    return [int(word) for word in words[:count]]


def _unpacked(packed: np.ndarray) -> np.ndarray:
    """Red, green, blue and alpha: the four bytes of a number, the lowest last."""
    bits = packed.view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.uint32)
    return np.stack([(bits >> shift).astype(np.uint8) for shift in (16, 8, 0, 24)], axis=-1)


def write(cloud: Cloud) -> bytes:
    """The cloud in the encoding that it was read in, else binary; 8-bit colours are packed.

    Coordinates are floats where they were floats and still are, else doubles. The points are in one row: an
    image of points is one no longer.

    Raises:
        UserError: a column that the format cannot hold, or the extra `[pcd]` is not installed.
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
    """The columns by names that a header can hold; a field `_` would be padding."""
    named: dict[str, np.ndarray] = {}
    for name, column in spread(columns, rest=False).items():
        word = re.sub(r"[^\w.-]", "_", name)
        named[unused(word if word.strip("_") else "column", [*named, "x", "y", "z"])] = column
    return named


def _packed(columns: dict[str, np.ndarray], packed: list[str]) -> dict[str, np.ndarray]:
    """The fields of a file; `packed` is the name and type of the packed colours, or empty where they are apart."""
    colours = [columns[name] for name in ("red", "green", "blue", "alpha") if name in columns]
    bytes_ = all(colour.dtype == np.uint8 and colour.ndim == 1 for colour in colours)
    pack = bool(packed) and bytes_ and {"red", "green", "blue"} <= columns.keys()
    fields: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if pack and name in ("green", "blue", "alpha"):
            continue
        if pack and name == "red":
            shifted = zip(colours, (16, 8, 0, 24), strict=False)
            bits = np.bitwise_or.reduce([colour.astype(np.uint32) << shift for colour, shift in shifted])
            # With alpha many of the floats would be no numbers, and text could not tell them apart.
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
