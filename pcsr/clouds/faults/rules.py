"""Faults of a cloud that is read in chunks: rules are derived from some of its points, and all points are tested."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int

from pcsr.clouds.faults.find import counted, shown
from pcsr.clouds.faults.outliers import BODY, FAR, far_outliers
from pcsr.clouds.faults.positions import Positions
from pcsr.clouds.faults.sentinels import ROUNDING, VALUES, frequent_sentinels, sentinel_values

NOT_FINITE = 0
"""Kind of a point with a coordinate that is not finite."""
HEALTHY = -1
"""Kind of a point without a fault."""


@dataclass(frozen=True, eq=False)
class Rules:
    """Rules by which each point of a cloud is tested on its own.

    They follow from a part of the cloud: a sample, and all points that may be faulty. A position is a sentinel by its
    frequency if it is one in that part.
    """

    values: tuple[tuple[int, float], ...]
    """Axis and value of coordinates that stand for a missing measurement."""
    spots: Float64[np.ndarray, "s 3"]
    """Positions that stand for an invalid pixel."""
    far: Float64[np.ndarray, "f 3"]
    """Positions of far outliers."""

    @classmethod
    def of(cls, points: Float64[np.ndarray, "n 3"]) -> "Rules":
        """Derive the rules from finite points, of which there is at least one."""
        positions = Positions.of(points)
        healthy = np.ones(len(positions.count), bool)
        values = []
        for axis, value, there in sentinel_values(positions.points):
            values.append((axis, value))
            healthy &= ~there
        left = np.flatnonzero(healthy)
        frequent = left[frequent_sentinels(positions.points[left], positions.count[left])]
        healthy[frequent] = False
        left = np.flatnonzero(healthy)
        far = left[far_outliers(positions.points[left])]
        return cls(tuple(values), positions.points[frequent], positions.points[far])

    def kinds(self, points: Float64[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Return the kind of each point's fault: `HEALTHY`, `NOT_FINITE`, or 1 and more, by the order of the rules."""
        kinds = np.full(len(points), HEALTHY, np.int16)
        kinds[~np.isfinite(points).all(axis=1)] = NOT_FINITE
        number = NOT_FINITE + 1
        for axis, value in self.values:
            with np.errstate(over="ignore", invalid="ignore"):
                there = np.abs(points[:, axis] - value) <= ROUNDING * abs(value)
            kinds[there & (kinds == HEALTHY)] = number
            number += 1
        for spot in self.spots:
            kinds[(points == spot).all(axis=1) & (kinds == HEALTHY)] = number
            number += 1
        for position in self.far:
            kinds[(points == position).all(axis=1) & (kinds == HEALTHY)] = number
        return kinds

    @property
    def count(self) -> int:
        """Number of kinds of faults."""
        return 1 + len(self.values) + len(self.spots) + (len(self.far) > 0)

    def sentence(self, kind: int, found: int, total: int, row: int, point: Float64[np.ndarray, "3"]) -> str:
        """Describe the faulty points of a kind, as `find_faults` does.

        Args:
            kind: kind of the fault.
            found: number of points with it.
            total: number of all points.
            row: row of the first of them.
            point: its coordinates.
        """
        where = f", such as point {row}, counted from 0"
        spots = NOT_FINITE + 1 + len(self.values)
        if kind == NOT_FINITE:
            return counted(found, total, f"have a coordinate that is not finite{where}, at {shown(point)}")
        if kind < spots:
            axis, value = self.values[kind - 1]
            what = f"have {'xyz'[axis]} = {value:.7g}, which marks a missing measurement"
            return counted(found, total, f"{what}{where}, at {shown(point)}")
        if kind < spots + len(self.spots):
            return counted(found, total, f"have the coordinates {shown(point)}, which mark an invalid pixel{where}")
        return counted(found, total, f"are far away from all others{where}, at {shown(point)}")


@dataclass(frozen=True, eq=False)
class Suspicion:
    """Test for points that may be faulty: all that are far from the middle, or have a coordinate of `VALUES`."""

    middle: Float64[np.ndarray, "3"]
    radius: float
    """Largest difference of a coordinate to the middle of points that are not suspicious."""

    @classmethod
    def of(cls, sample: Float64[np.ndarray, "n 3"]) -> "Suspicion":
        """Derive the test from a sample of the cloud, of at least one finite point."""
        rules = Rules.of(sample)
        healthy = sample[rules.kinds(sample) == HEALTHY]
        healthy = healthy if len(healthy) else sample
        middle = np.median(healthy, axis=0)
        size = float(np.quantile(np.abs(healthy - middle).max(axis=1), BODY, method="lower"))
        return cls(middle, (FAR - 1) * size)

    def __call__(self, points: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Return which of the points are finite and suspicious."""
        with np.errstate(invalid="ignore", over="ignore"):
            suspicious = np.abs(points - self.middle).max(axis=1) >= self.radius
            for value in VALUES:
                suspicious |= (np.abs(points - value) <= ROUNDING * abs(value)).any(axis=1)
        found: Bool[np.ndarray, " n"] = suspicious & np.isfinite(points).all(axis=1)
        return found
