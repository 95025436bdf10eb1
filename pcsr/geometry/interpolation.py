"""Upsampling without learning: midpoints between neighbours, thinned to the right number.

The interpolation that Grad-PU (He et al., CVPR 2023, Sec. 3.2) starts from, and a baseline that ties it:
every learned model has to beat it.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.errors import UserError
from pcsr.geometry.sampling import farthest_points


def midpoint(
    points: Float[np.ndarray, "n 3"], rate: float, passes: int = 1
) -> Float[np.ndarray, "rn 3"]:
    """Interpolate a cloud to round(rate·n) points.

    In each of the passes every point is joined with its 2s nearest (itself among them), s being that pass's
    share of the rate, and the midpoints are thinned by farthest points. Two passes of 4 beat one of 16 by far:
    the second knows the midpoints of the first.

    Args:
        points: the sparse cloud, in any frame.
        rate: new points for each point, at least 1; need not be whole.
        passes: how often to interpolate; each pass takes the same share of the rate.

    Raises:
        UserError: the rate is below 1, or there are too few points for the neighbours.
    """
    if rate < 1 or passes < 1:
        raise UserError(f"midpoint: rate is {rate:g} and passes {passes}, both must be at least 1")
    count = len(points)
    cloud = np.asarray(points, np.float64)
    for number in range(1, passes + 1):
        goal = round(count * rate ** (number / passes))
        cloud = _one_pass(cloud, goal)
    return cloud


def _one_pass(points: Float[np.ndarray, "n 3"], goal: int) -> Float[np.ndarray, "goal 3"]:
    neighbours = int(np.ceil(2 * goal / len(points)))
    if neighbours > len(points):
        raise UserError(
            f"midpoint: {len(points)} points have no {neighbours} neighbours each: give more points or a lower rate"
        )
    _, index = cKDTree(points).query(points, k=neighbours)
    middle = (points[:, None] + points[index.reshape(len(points), neighbours)]) / 2
    candidates = middle.reshape(-1, 3)
    return candidates[farthest_points(candidates, goal)]
