"""Precision in which the coordinates of a cloud are written."""

import numpy as np

from pcsr.clouds.cloud import Cloud

NEGLIGIBLE = 1e-6
"""Rounding error that a format of single precision may add, relative to the extent of the cloud."""


def coordinates(cloud: Cloud, *, prefer_single: bool = False) -> np.ndarray:
    """Return the coordinates of a cloud (n, 3), in single precision if they were read so and need no more.

    Args:
        cloud: the cloud.
        prefer_single: allow an error of `NEGLIGIBLE`, as decimal numbers have in a text file that declares them single.
    """
    if not cloud.is_single:
        return cloud.points
    with np.errstate(over="ignore"):
        single = cloud.points.astype(np.float32)
    if np.array_equal(single, cloud.points):
        return single
    if prefer_single and np.isfinite(single).all():
        moved = np.abs(single - cloud.points).max()
        if moved <= NEGLIGIBLE * np.ptp(cloud.points, axis=0).max():
            return single
    return cloud.points
