"""Points so far from a cloud that the cloud is a speck beside their distance."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from pcsr.geometry.magnitude import exponent, scaled

BODY = 0.9
"""Share of the positions whose extent is the size of a cloud."""
FAR = 20.0
"""An outlier is this many times the size of the cloud away from others."""
NEIGHBOURS = 15
"""Largest number of positions that are outliers although they lie together; more of them are an object."""
FEWEST = 16
"""Smallest number of positions among which outliers are searched for."""


def far_outliers(positions: Float64[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
    """Return which of the distinct positions are far outliers.

    The size of a cloud is the distance within which `BODY` of its positions lie around the median. A position is a
    far outlier if its `NEIGHBOURS`-th neighbour is at least `FAR` sizes away. So a second object is none, however far
    away it is, and neither are the sparse points of a scanner's largest range. Distances are the largest difference of
    a coordinate: squares of very different coordinates would not fit into doubles.

    Args:
        positions: finite coordinates, each once.
    """
    far = np.zeros(len(positions), bool)
    if len(positions) < FEWEST:
        return far
    points = scaled(positions, -exponent([positions]))
    radius = np.abs(points - np.median(points, axis=0)).max(axis=1)
    size = float(np.quantile(radius, BODY, method="lower"))
    # Whatever is nearer to the median is nearer than FAR sizes to nine tenths of the cloud.
    candidates = np.flatnonzero(radius >= (FAR - 1) * size)
    if not len(candidates):
        return far
    rank = 1 + min(NEIGHBOURS, len(points) // 2)  # the first is the position itself
    distance = cKDTree(points).query(points[candidates], k=[rank], p=np.inf)[0][:, 0]
    far[candidates] = distance >= FAR * size
    return far
