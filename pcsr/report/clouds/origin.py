"""Origin of a cloud's points: which of them another cloud has too."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import KDTree

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import spread
from pcsr.report.clouds.colouring import SOURCE, source_column

SAME = 1e-6
"""Distance up to which points are the same, as a share of the old cloud's size: that of seven digits in a text file."""
SINGLE = 2.0**-23
"""Rounding of single precision, relative to a coordinate."""


def with_origin(cloud: Cloud, old: Cloud) -> tuple[Cloud, int]:
    """Return a cloud with the column `source` anew: 0 for points that another cloud has too, else 1.

    Points that a column `source` calls touched (2) stay so.

    Returns:
        The cloud, and its number of old points.
    """
    known = in_both(cloud.points, old.points)
    source = np.where(known, 0, 1).astype(np.uint8)
    before = source_column(spread(cloud.columns, rest=True))
    if before is not None:
        source[~known & (before == 2)] = 2
    return replace(cloud, columns={**cloud.columns, SOURCE: source}), int(known.sum())


def in_both(points: Float64[np.ndarray, "n 3"], old: Float64[np.ndarray, "m 3"]) -> Bool[np.ndarray, " n"]:
    """Return which points coincide with an old one, but for the digits that a file format drops."""
    middle = np.median(old, axis=0)
    size = float(np.quantile(np.abs(old - middle), 0.98))
    rounding = max(_rounding(points), _rounding(old))
    distance, _ = KDTree(old - middle).query(points - middle)
    known: Bool[np.ndarray, " n"] = distance <= max(SAME * size, rounding)
    return known


def _rounding(points: Float64[np.ndarray, "n 3"]) -> float:
    """Largest rounding error of coordinates that a file kept in single precision; 0 for doubles."""
    with np.errstate(over="ignore"):
        single = points.astype(np.float32).astype(np.float64)
    if not np.array_equal(single, points):
        return 0.0
    return SINGLE * float(np.quantile(np.abs(points).max(1), 0.98))
