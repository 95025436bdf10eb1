"""Reader of `points3D.bin` and `points3D.txt`, the points that COLMAP reconstructs from photographs."""

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import text
from pcsr.errors import UserError

POINT = np.dtype([("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("length", "<u8")])
"""A point without its track."""
SEEN = 8
"""Size in bytes of an element of a track: image and feature."""


def read(data: bytes) -> Cloud:
    """Read positions, colours, ids and reprojection errors. The tracks, which list the images of a point, are left out.

    Raises:
        UserError: the file is cut off or of another format.
    """
    if data[:1] in b"#0123456789" and data[:64].isascii() and b"\0" not in data[:64]:
        return text.read_xyz(data)
    count = int.from_bytes(data[:8], "little")
    if len(data) < 8 or count > (len(data) - 8) // POINT.itemsize:
        there = max(0, len(data) - 8) // POINT.itemsize
        raise UserError(
            f"it claims {count} points and has room for {there} at most: it is cut off, or no points3D.bin of COLMAP"
        )
    raw = np.frombuffer(data, np.uint8)
    starts = _starts(data, count)
    rows = raw[starts[:, None] + np.arange(POINT.itemsize)].copy().view(POINT)[:, 0]
    columns = dict(zip(("red", "green", "blue"), np.ascontiguousarray(rows["rgb"].T), strict=True))
    columns |= {"point3d_id": rows["id"].astype(np.int64), "error": rows["error"].astype(np.float64)}
    notes = ("the tracks of its points, the images that show them, were left out",) if rows["length"].any() else ()
    return Cloud(rows["xyz"].astype(np.float64), columns, {"notes": notes})


def _starts(data: bytes, count: int) -> np.ndarray:
    """Return where each point begins, by the lengths of the tracks.

    Raises:
        UserError: the file ends before its last point, or goes on after it.
    """
    starts, at, before = np.zeros(count, np.int64), 8, POINT.itemsize - 8
    for number in range(count):
        starts[number] = at
        length = int.from_bytes(data[at + before : at + POINT.itemsize], "little")
        at += POINT.itemsize + SEEN * length
        if at > len(data):
            raise UserError(f"it is cut off or damaged: {number} of its {count} points are there")
    if at != len(data):
        raise UserError(f"it goes on for {len(data) - at} bytes after its {count} points: it is no points3D.bin")
    return starts
