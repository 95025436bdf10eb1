"""Direction from which a cloud was seen, by the hidden point removal operator.

Katz, Tal and Basri, "Direct visibility of point sets" (SIGGRAPH 2007).
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import ConvexHull, QhullError

from pcsr.exploration.surface import thin

DIRECTIONS = 100
"""Number of directions that are tried."""
POINTS = 1500
"""Clouds of more points are thinned to about as many for the search."""
DISTANCE = 3.0
"""Distance of the viewpoint from the centroid, in radii of the cloud."""
SPHERE = 1.5
"""Decimal logarithm of the radius of the sphere at which points are reflected, in distances of the farthest point."""
ENOUGH = 0.8
"""Share of the points that must be visible from the best direction, if the cloud was seen from there alone."""
AS_GOOD = 0.02
"""Directions whose share is at most this much smaller than the largest one are averaged."""


def seen_from(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"] | None:
    """Estimate the direction from which a cloud was seen.

    It is the mean of two: that from which most points are visible, and that in which the cloud lies before the centroid
    of its convex hull, since it bulges towards the camera.

    Args:
        points: the cloud, in any unit.

    Returns:
        Unit vector towards the camera; None if there is no direction from which at least 80 % of the points are
        visible, so that the cloud shows several sides of the object.

    Examples:
        >>> ball = np.random.default_rng(0).normal(size=(500, 3))
        >>> ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        >>> seen_from(ball) is None
        True
        >>> bool(seen_from(ball[ball[:, 2] > 0])[2] > 0.9)
        True
    """
    some = _thinned(points)
    try:
        bulge = some.mean(0) - _hull_centroid(some)
    except QhullError:  # all points on a plane
        return None
    directions = _directions(DIRECTIONS)
    shares = np.array([visible(some, direction).mean() for direction in directions])
    shares[directions @ bulge < 0] = 0.0
    if shares.max() < ENOUGH:
        return None
    best = directions[shares >= shares.max() - AS_GOOD].mean(0)
    both = best / max(float(np.linalg.norm(best)), 1e-9) + bulge / max(float(np.linalg.norm(bulge)), 1e-9)
    found: Float[np.ndarray, 3] = both / max(float(np.linalg.norm(both)), 1e-9)
    return found


def _hull_centroid(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """Return the centroid of the volume of the convex hull."""
    hull = ConvexHull(points)
    middle = points[hull.vertices].mean(0)
    corners = points[hull.simplices] - middle
    volumes = np.abs(np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))
    centroid: Float[np.ndarray, 3] = middle + (corners.sum(1) / 4 * volumes[:, None]).sum(0) / volumes.sum()
    return centroid


def visible(points: Float[np.ndarray, "n 3"], direction: Float[np.ndarray, "3"]) -> Bool[np.ndarray, " n"]:
    """Find the points that are visible from a direction, three radii away; none if the points are on a plane."""
    centre = points.mean(0)
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    rays = points - (centre + DISTANCE * radius * direction)
    length = np.linalg.norm(rays, axis=1, keepdims=True)
    reflected = rays + 2 * (length.max() * 10**SPHERE - length) * rays / length
    found = np.zeros(len(points), bool)
    try:
        corners = ConvexHull(np.concatenate([reflected, np.zeros((1, 3))])).vertices
    except QhullError:
        return found
    found[corners[corners < len(points)]] = True
    return found


def _thinned(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    if len(points) <= POINTS:
        return points
    cell = float(np.ptp(points, axis=0).max()) / 64
    while len(thinned := thin(points, cell)) > POINTS:
        cell *= 1.3
    return thinned


def _directions(count: int) -> Float[np.ndarray, "count 3"]:
    """Return unit vectors that are spread evenly, along a spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + 5**0.5) * np.arange(count)
    across = np.sqrt(1 - height**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
