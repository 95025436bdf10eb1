"""Midpoint interpolation: upsampling without learning, and a baseline for every learned model.

Grad-PU (He et al., CVPR 2023, Sec. 3.2) starts from this interpolation, and scores about the same.
"""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import UserError
from pcsr.geometry.farthest import farthest_points

Thin = Callable[[Float[np.ndarray, "n 3"], int], Int[np.ndarray, " count"]]
"""Function that chooses a number of points from a cloud and returns their indices."""


def midpoint(
    points: Float[np.ndarray, "n 3"], rate: int | float, passes: int = 1, thin: Thin = farthest_points
) -> Float[np.ndarray, "rn 3"]:
    """Interpolate a cloud to round(rate·n) points by midpoints between neighbours.

    Each pass computes the midpoints between every point and its 2s nearest neighbours (itself included), and keeps a
    subset of them; s = rate^(1/passes) is the rate of one pass. Two passes of rate 4 are far better than one of rate
    16, since the second uses the midpoints of the first.

    Args:
        points: the sparse cloud, in any frame.
        rate: ratio of output to input points, at least 1; it need not be an integer.
        passes: number of passes.
        thin: function that chooses a given number of points from a cloud and returns their indices. The baseline uses
            farthest point sampling, which takes nearly all of the time.

    Returns:
        The dense cloud in the frame of `points`; float64.

    Raises:
        UserError: the rate is below 1, or there are too few points for the neighbours.

    Examples:
        >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
        >>> midpoint(square, rate=2).shape
        (8, 3)
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
        raise UserError(
            f"midpoint: {n} points are fewer than the {neighbours} neighbours that each needs: "
            f"give more points or a lower rate"
        )
    index = cKDTree(points).query(points, k=neighbours)[1]
    first, second = np.repeat(np.arange(n), neighbours), index.ravel()
    # Each pair once, though it may occur from both of its points: `thin` would drop the copies, but more slowly.
    pairs = np.unique(np.minimum(first, second) * n + np.maximum(first, second))
    candidates = (points[pairs // n] + points[pairs % n]) / 2
    thinned: Float[np.ndarray, "goal 3"] = candidates[thin(candidates, goal)]
    return thinned
