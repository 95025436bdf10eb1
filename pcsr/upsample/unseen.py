"""Touched points in regions where the cloud has no points, such as a side that no camera saw."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.geometry.anchoring import spread_prefix
from pcsr.geometry.farthest import farthest_points
from pcsr.tensors import CloudArray
from pcsr.upsample.gaps import REACH, spacing

EVEN = 0.85
"""Least distance of subsampled points, in spacings of the cloud. Evenly spaced points at this distance are about as
dense as random points of spacing 1."""
FIRST = 64
"""Number of points in the first attempt at subsampling. It is multiplied by 4 until it suffices."""


def unseen(points: Float[np.ndarray, "n 3"], touches: Sequence[CloudArray]) -> CloudArray:
    """Select touched points in regions without cloud points, subsampled to the cloud's median density.

    A touched point is in such a region if it is farther from every point than new points may be (`gaps.REACH`). Touches
    are much denser than the cloud. Without subsampling they would attract all new points.

    Args:
        points: the cloud, (n 3), in any frame and unit.
        touches: touched points, one array for each touch, in the same frame and unit.

    Returns:
        The selected points, unchanged, in the order of farthest point sampling; (0 3) if there is no such region.
    """
    if not touches:
        return np.zeros((0, 3))
    touched = np.unique(np.concatenate(touches), axis=0)
    seen = np.unique(points, axis=0)  # the spacing at a duplicate point would be 0
    own = spacing(seen)
    distance, nearest = cKDTree(seen).query(touched)
    touched = touched[distance > REACH * own[nearest]]
    if len(touched) == 0:
        return np.zeros((0, 3))
    return evenly(touched, float(np.median(own)))  # the nearest points lie at a border, where the cloud is sparser


def evenly(touched: Float[np.ndarray, "m 3"], median: float) -> CloudArray:
    """Subsample touched points to the density of a cloud, in the order of farthest point sampling.

    Args:
        touched: distinct points, at least one.
        median: median spacing of the cloud.
    """
    apart, count = EVEN * median, FIRST
    while True:  # of a million recorded points only a few hundred are kept
        ordered: CloudArray = touched[farthest_points(touched, min(count, len(touched)))]
        kept = spread_prefix(ordered, apart)
        if kept < len(ordered) or kept == len(touched):
            break
        count *= 4
    return ordered[:kept]
