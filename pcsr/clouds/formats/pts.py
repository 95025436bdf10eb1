"""PTS files of Leica scanners: the number of points, then x, y, z, intensity, red, green and blue on each line."""

from collections.abc import Sequence

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, spread
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
    colours = [columns.pop(name) for name in COLOURS[:3] if name in columns]
    columns.pop("alpha", None)
    intensity = [columns.pop(name) for name in list(columns) if name.lower() == "intensity"]
    if columns or len(colours) not in (0, 3) or len(intensity) > 1:
        raise UserError(
            f"a .pts holds points, an intensity and complete colours, not the columns "
            f"{', '.join(columns) or 'of this cloud'}: write a .ply"
        )
    table = [*cloud.points.T, *intensity, *map(_in_bytes, colours)]
    return (f"{len(cloud)}\n" + "".join(" ".join(row) + "\n" for row in zip(*map(words, table), strict=True))).encode()


def _in_bytes(colour: np.ndarray) -> np.ndarray:
    if colour.dtype == np.uint8:
        return colour
    share = colour / np.iinfo(colour.dtype).max if colour.dtype in (np.uint16, np.uint32) else colour.astype(np.float64)
    highest = np.nanmax(share, initial=0)
    return np.rint(np.clip(np.nan_to_num(share) * (255 if highest <= 1 else 1), 0, 255)).astype(np.uint8)
