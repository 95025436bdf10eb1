"""PTS files of Leica scanners: the number of points, then x, y, z, intensity, red, green and blue on each line."""

from collections.abc import Sequence

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, spread
from pcsr.clouds.formats.colours import in_bytes
from pcsr.clouds.formats.digits import words
from pcsr.clouds.formats.text import read_as
from pcsr.errors import UserError

NAMES = {
    4: ["intensity"],
    6: [*COLOURS[:3]],
    7: ["intensity", *COLOURS[:3]],
    10: ["intensity", *COLOURS[:3], "nx", "ny", "nz"],
}
"""Names of the columns beside the coordinates, by the number of columns."""


def read_pts(data: bytes, *, columns: str | Sequence[str] | None = None, all_columns: bool = True) -> Cloud:
    """Read one or several scans, each with or without its number of points.

    Args:
        data: content of the file.
        columns: as in `read_xyz`.
        all_columns: as in `read_xyz`.
    """
    return read_as(data, NAMES, columns=columns, all_columns=all_columns)


def write_pts(cloud: Cloud) -> bytes:
    """Write one scan, with colours from 0 to 255.

    Raises:
        UserError: the cloud has columns that the format cannot hold.
    """
    columns = spread(cloud.columns, rest=True)
    given = {name: np.nan_to_num(columns.pop(name), nan=0) for name in COLOURS[:3] if name in columns}
    colours = in_bytes(given).values()
    columns.pop("alpha", None)
    intensity = [columns.pop(name) for name in list(columns) if name.lower() == "intensity"]
    if columns or len(colours) not in (0, 3) or len(intensity) > 1:
        raise UserError(
            f"a .pts holds points, an intensity and complete colours, not the columns "
            f"{', '.join(columns) or 'of this cloud'}: write a .ply"
        )
    if any(colour.dtype != np.uint8 for colour in colours):
        raise UserError("a .pts holds colours from 0 to 255, and those of this cloud have another range: write a .ply")
    table = [*cloud.points.T, *intensity, *colours]
    return (f"{len(cloud)}\n" + "".join(" ".join(row) + "\n" for row in zip(*map(words, table), strict=True))).encode()
