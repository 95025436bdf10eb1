"""Upsampling without learning: midpoints between neighbours, thinned to the right number.

The interpolation that Grad-PU (He et al., CVPR 2023, Sec. 3.2) starts from, and a baseline that ties it:
every learned model has to beat it.
"""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError
from pcsr.geometry.farthest import farthest_points

Thin = Callable[[Float[np.ndarray, "n 3"], int], Int[np.ndarray, " count"]]


def midpoint(
    points: Float[np.ndarray, "n 3"], rate: int | float, passes: int = 1, thin: Thin = farthest_points
) -> Float[np.ndarray, "rn 3"]:
    """Interpolate a cloud to round(rate·n) points.

    In each of the passes every point is joined with its 2s nearest (itself among them), s being that pass's
    share of the rate, and the midpoints are thinned by farthest points. Two passes of 4 beat one of 16 by
    far: the second knows the midpoints of the first.

    Args:
        points: the sparse cloud, in any frame.
        rate: new points for each point, at least 1; need not be whole.
        passes: how often to interpolate; each pass takes the same share of the rate.
        thin: which of the midpoints to keep, and how many. Farthest points define the baseline, and take nearly all
            of the time.

    Returns:
        The dense cloud in the frame of `points`; float64.

    Raises:
        UserError: the rate is below 1, or there are too few points for the neighbours.
    """
    if rate < 1 or passes < 1:
        raise UserError(f"midpoint: rate is {rate:g} and passes {passes}, both must be at least 1")
    cloud = np.asarray(points, np.float64)
    for number in range(1, passes + 1):
        cloud = _one_pass(cloud, round(len(points) * rate ** (number / passes)), thin)
    return cloud


def _one_pass(points: Float[np.ndarray, "n 3"], goal: int, thin: Thin) -> Float[np.ndarray, "goal 3"]:
    n = len(points)
    neighbours = math.ceil(2 * goal / n) if n else 2
    if neighbours > n:
        raise UserError(f"midpoint: {n} points have no {neighbours} neighbours each: give more points or a lower rate")
    index = cKDTree(points).query(points, k=neighbours)[1]
    first, second = np.repeat(np.arange(n), neighbours), index.ravel()
    # Each pair once, though both its points may name it: thinning would drop the copy, later and slower.
    pairs = np.unique(np.minimum(first, second) * n + np.maximum(first, second))
    candidates = (points[pairs // n] + points[pairs % n]) / 2
    thinned: Float[np.ndarray, "goal 3"] = candidates[thin(candidates, goal)]
    return thinned
