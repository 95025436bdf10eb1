"""Search for the faults of a cloud, each as a sentence with a number and an example."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int

from pcsr.clouds.faults.near_copies import near_copies
from pcsr.clouds.faults.outliers import far_outliers
from pcsr.clouds.faults.positions import Positions
from pcsr.clouds.faults.sentinels import frequent_sentinels, sentinel_values

SINGULAR = {"are": "is", "have": "has"}
"""Verbs of sentences about one point."""


@dataclass(frozen=True, eq=False)
class Fault:
    """Points of a cloud with the same fault."""

    rows: Int[np.ndarray, " m"]
    """Rows of the points, counted from 0. Of equal points the first is not among the duplicates."""
    sentence: str
    """Number of the points, the fault, and an example."""
    harmful: bool
    """Whether the points would spoil an upsampled cloud. Duplicates do not, since each position is used once."""


def find_faults(points: Float64[np.ndarray, "n 3"]) -> list[Fault]:
    """Find points that are not finite, sentinels of invalid pixels, far outliers and duplicates.

    A point has one fault at most. The order of the points and the unit have no influence, and the origin has none but
    for sentinels, whose values belong to the frame of the sensor.

    Args:
        points: the cloud, with coordinates of any value.

    Examples:
        >>> grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), -1).reshape(-1, 3)
        >>> find_faults(grid)
        []
        >>> find_faults(np.concatenate([grid, [[1e6, 0, 0]]]))[0].sentence
        '1 of 65 points is far away from all others, such as point 64, counted from 0, at (1e+06, 0, 0)'
    """
    return list(_faults(points))


def _faults(points: Float64[np.ndarray, "n 3"]) -> Iterator[Fault]:
    finite = np.isfinite(points).all(axis=1)
    rows = np.flatnonzero(finite)
    if len(rows) < len(points):
        yield _fault(points, np.flatnonzero(~finite), "have a coordinate that is not finite")
    if not len(rows):
        return
    positions = Positions.of(points[rows])
    healthy = np.ones(len(positions.count), bool)
    for axis, value, there in sentinel_values(positions.points):
        marked = there & healthy
        healthy &= ~there
        if marked.any():
            fault = f"have {'xyz'[axis]} = {value:.7g}, which marks a missing measurement"
            yield _fault(points, rows[positions.rows(marked)], fault)
    left = np.flatnonzero(healthy)
    frequent = left[frequent_sentinels(positions.points[left], positions.count[left])]
    for one in frequent:
        there = np.arange(len(healthy)) == one
        fault = f"have the coordinates {shown(positions.points[one])}, which mark an invalid pixel"
        yield _fault(points, rows[positions.rows(there)], fault, at=False)
    healthy[frequent] = False
    left = np.flatnonzero(healthy)
    far = left[far_outliers(positions.points[left])]
    if len(far):
        healthy[far] = False
        there = np.isin(np.arange(len(healthy)), far)
        yield _fault(points, rows[positions.rows(there)], "are far away from all others")
    first = np.zeros(len(rows), bool)
    first[positions.first] = True
    copies = np.flatnonzero(healthy[positions.index] & ~first)
    if len(copies):
        what = "are exact copies of others" if len(copies) > 1 else "are an exact copy of another"
        original = rows[positions.first[positions.index[copies[0]]]]
        yield Fault(
            rows[copies],
            f"{counted(len(copies), len(points), what)}, such as point {rows[copies[0]]} of "
            f"point {original}, counted from 0",
            harmful=False,
        )
    left = np.flatnonzero(healthy)
    left = left[np.argsort(positions.first[left])]
    near = left[near_copies(positions.points[left])]
    if len(near):
        what = "are copies of others but for rounding" if len(near) > 1 else "are a copy of another but for rounding"
        yield _fault(points, np.sort(rows[positions.first[near]]), what, harmful=False)


def _fault(
    points: Float64[np.ndarray, "n 3"], rows: Int[np.ndarray, " m"], what: str, *, at: bool = True, harmful: bool = True
) -> Fault:
    where = f", at {shown(points[rows[0]])}" if at else ""
    sentence = f"{counted(len(rows), len(points), what)}, such as point {rows[0]}, counted from 0{where}"
    return Fault(rows, sentence, harmful)


def counted(found: int, total: int, what: str) -> str:
    """Begin a sentence about a number of points; `what` begins with "are" or "have"."""
    verb, _, rest = what.partition(" ")
    return f"{found} of {total} points {SINGULAR[verb] if found == 1 else verb} {rest}"


def shown(point: Float64[np.ndarray, "3"]) -> str:
    """Format a point for a sentence."""
    return f"({', '.join(f'{number:.6g}' for number in point)})"
