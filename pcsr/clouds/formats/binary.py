"""Scans of data sets for driving, as rows of single-precision numbers without a header: KITTI and nuScenes."""

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native
from pcsr.errors import UserError

KITTI = ("x", "y", "z", "intensity")
"""Numbers of a point in a scan of KITTI."""
NUSCENES = (*KITTI, "ring")
"""Numbers of a point in a scan of nuScenes."""
MOST_RINGS = 256
"""Most rings (lasers) of a scanner. nuScenes has 32."""
BRIGHTEST = 65535
"""Largest intensity. That of KITTI is at most 1, that of nuScenes at most 255."""
FARTHEST, NEAREST = 1e5, 1e-6
"""Bounds of the size of coordinates that are not 0, in metres."""
MOST_STRAYS = 0.01
"""Largest share of coordinates outside of these bounds. Bytes of other numbers, such as doubles, have more."""


def read_kitti(data: bytes) -> Cloud:
    """Read a scan of KITTI: x, y, z and intensity of each point, in single precision.

    Raises:
        UserError: the size of the file is no multiple of a point's, or its numbers are none of a scan.
    """
    rows = _rows(data, KITTI, "kitti", "nuscenes")
    notes: tuple[str, ...] = ()
    fifth = rows.reshape(-1)[4 :: len(NUSCENES)] if rows.size % len(NUSCENES) == 0 else np.zeros(0)
    if len(fifth) > 1 and _are_rings(fifth) and not _are_rings(rows):
        notes = ("every fifth number is whole, as the ring of nuScenes: if it is of nuScenes, read it as that",)
    return _cloud(rows, {"intensity": rows[:, 3]}, "kitti", notes)


def read_nuscenes(data: bytes) -> Cloud:
    """Read a scan of nuScenes: x, y, z, intensity and ring of each point, in single precision.

    Raises:
        UserError: the size of the file is no multiple of a point's, its numbers are none of a scan, or a ring is no
            whole number.
    """
    rows = _rows(data, NUSCENES, "nuscenes", "kitti")
    rings = rows[:, 4]
    if not _are_rings(rings):
        bad = int(np.flatnonzero(~((rings >= 0) & (rings < MOST_RINGS) & (rings == np.rint(rings))))[0])
        raise UserError(
            f"the ring of point {bad} is {rings[bad]:g}, and rings are whole numbers from 0 on: it is no file of "
            f"nuScenes; that of KITTI has four numbers a point (--format kitti)"
        )
    return _cloud(rows, {"intensity": rows[:, 3], "ring": rings.astype(np.uint8)}, "nuscenes", ())


def _rows(data: bytes, names: tuple[str, ...], kind: str, other: str) -> np.ndarray:
    size = 4 * len(names)
    if len(data) % size:
        raise UserError(
            f"its {len(data)} bytes are no multiple of {size}, the size of a point ({' '.join(names)}): it is cut off, "
            f"or not of {kind} (--format {other}?)"
        )
    rows = np.frombuffer(data, "<f4").reshape(-1, len(names))
    if kind != "nuscenes" or _are_rings(rows[:, 4]):  # the rings of another file say more
        _check_plausible(rows, kind)
    return rows


def _check_plausible(rows: np.ndarray, kind: str) -> None:
    """Check that rows may be those of a scan, since a file without a header can be read as anything.

    Raises:
        UserError: an intensity is negative or too large, or many coordinates are far too large or small.
    """
    remedy = f"the file is not of {kind}, or its points have other numbers than these: convert it to .ply"
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero((rows[:, 3] < 0) | (rows[:, 3] > BRIGHTEST))
        size = np.abs(rows[:, :3])
        strays = (size > FARTHEST) | ((size < NEAREST) & (size > 0))
    if len(wrong):
        raise UserError(f"the intensity of point {wrong[0]} is {rows[wrong[0], 3]:g}, no value from 0 on: {remedy}")
    if strays.sum() > MOST_STRAYS * strays.size:
        value = rows[:, :3][strays][0]
        raise UserError(f"{strays.mean():.0%} of its coordinates are as {value:g}, which no scanner measures: {remedy}")


def _are_rings(numbers: np.ndarray) -> bool:
    with np.errstate(invalid="ignore"):
        return bool(((numbers >= 0) & (numbers < MOST_RINGS) & (numbers == np.rint(numbers))).all())


def _cloud(rows: np.ndarray, columns: dict[str, np.ndarray], kind: str, notes: tuple[str, ...]) -> Cloud:
    about = {kind: {"coordinates": "f4"}, "notes": notes}
    return Cloud(rows[:, :3].astype(np.float64), {name: native(column) for name, column in columns.items()}, about)
