"""Touched points where the cloud has none: a side that no camera saw, which a finger reached."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.geometry.anchoring import spread_prefix
from pcsr.geometry.farthest import farthest_points
from pcsr.tensors import CloudArray
from pcsr.upsample.gaps import REACH, spacing

EVEN = 0.85
"""Even points that keep so much of a spacing from each other are about as dense as random ones of that spacing."""
FIRST = 64
"""So many points are tried first; four times as many, if all of them are far enough from each other, and so on."""


def unseen(points: Float[np.ndarray, "n 3"], touches: Sequence[CloudArray]) -> CloudArray:
    """Touched points that are new to the cloud, as dense as its own are in the median.

    New is what lies farther from every point than new points may (`gaps.REACH`). A finger feels hundreds of points
    where the cloud would have ten: all of them would weigh more than what was seen, and draw all new points to them.

    Args:
        points: the cloud, in any frame and unit.
        touches: touched points in the same.

    Returns:
        Some of the touched points, exactly; the first are the farthest from each other. None, if the cloud has points
        wherever something was touched.
    """
    if not touches:
        return np.zeros((0, 3))
    touched = np.unique(np.concatenate(touches), axis=0)
    seen = np.unique(points, axis=0)  # beside a copy of itself no point has a spacing
    own = spacing(seen)
    distance, nearest = cKDTree(seen).query(touched)
    touched = touched[distance > REACH * own[nearest]]
    if len(touched) == 0:
        return np.zeros((0, 3))
    apart, count = EVEN * float(np.median(own)), FIRST  # the nearest are at a border, and sparser than the rest
    while True:  # a recording may hold a million points, of which a few hundred are kept
        ordered: CloudArray = touched[farthest_points(touched, min(count, len(touched)))]
        kept = spread_prefix(ordered, apart)
        if kept < len(ordered) or kept == len(touched):
            break
        count *= 4
    return ordered[:kept]
