"""A ball that is pressed into a gel: the slopes that it gives the gel, and what is found of it in measured slopes.

Lengths are in pixels. Heights are those of the ball's surface in the gel, so that they fall with the distance from the
ball's centre.
"""

import numpy as np
from jaxtyping import Float
from scipy import ndimage
from scipy.optimize import least_squares

RIM = (0.3, 0.95)
"""Least and greatest radius of a contact, as a share of the ball's radius."""
FEWEST = 9
"""Least number of pixels that determine a centre."""


def ball_slopes(
    columns: Float[np.ndarray, " n"], rows: Float[np.ndarray, " n"], centre: Float[np.ndarray, "2"], radius: float
) -> Float[np.ndarray, "n 2"]:
    """Compute the slopes of a ball's surface along x and y at pixels that lie within its radius."""
    x, y = columns - centre[0], rows - centre[1]
    down = np.sqrt(radius**2 - x**2 - y**2)
    return np.stack([-x / down, -y / down], axis=-1)


def voted_centre(
    columns: Float[np.ndarray, " n"], rows: Float[np.ndarray, " n"], slopes: Float[np.ndarray, "n 2"], radius: float
) -> Float[np.ndarray, "2"]:
    """Return the median of the ball's centres that the slope of each pixel in contact implies."""
    sine = slopes / np.sqrt(1 + (slopes**2).sum(1, keepdims=True))
    votes: Float[np.ndarray, 2] = np.median(np.stack([columns, rows], axis=-1) + radius * sine, axis=0)
    return votes


def rim_radius(
    columns: Float[np.ndarray, " n"],
    rows: Float[np.ndarray, " n"],
    slopes: Float[np.ndarray, "n 2"],
    centre: Float[np.ndarray, "2"],
    radius: float,
) -> float:
    """Return the radius of the contact: the distance from the centre at which the mean slope is steepest.

    Up to the rim a ball becomes steeper; beyond it the gel becomes flatter.
    """
    x, y = columns - centre[0], rows - centre[1]
    distance = np.hypot(x, y)
    inward = -(slopes[:, 0] * x + slopes[:, 1] * y) / np.maximum(distance, 1e-9)
    ring = np.rint(distance).astype(int)
    last = int(RIM[1] * radius) + 4
    near = ring < last
    counts = np.bincount(ring[near], minlength=last)
    profile = ndimage.gaussian_filter1d(np.bincount(ring[near], inward[near], last) / np.maximum(counts, 1), 1.5)
    first = max(2, int(RIM[0] * radius))
    steepest = first + int(np.argmax(profile[first : max(first + 1, int(RIM[1] * radius))]))
    before, at, after = profile[steepest - 1 : steepest + 2]
    curvature = before - 2 * at + after
    step = 0.5 * (before - after) / curvature if curvature < -1e-9 else 0.0
    return float(np.clip(steepest + np.clip(step, -0.5, 0.5), RIM[0] * radius, RIM[1] * radius))


def fitted_sphere(points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "3"], float]:
    """Fit a sphere by least squares of the distances from it.

    Returns:
        Its centre and radius.
    """
    design = np.column_stack([points, np.ones(len(points))])
    start = np.linalg.lstsq(design, -(points**2).sum(1), rcond=None)[0]
    centre = -start[:3] / 2
    radius = np.sqrt(max(centre @ centre - start[3], 1.0))
    found = least_squares(lambda p: np.linalg.norm(points - p[:3], axis=1) - p[3], [*centre, radius]).x
    return found[:3], float(abs(found[3]))


def fitted_ball(points: Float[np.ndarray, "n 3"], radius: float) -> Float[np.ndarray, "3"]:
    """Return the centre of the ball of known radius that fits points best."""
    x, y, z = points.T
    start = [np.mean(x), np.mean(y), z.max() - radius]
    found: Float[np.ndarray, 3] = least_squares(lambda p: np.linalg.norm(points - p, axis=1) - radius, start).x
    return found


def distance_to_ball(points: Float[np.ndarray, "n 3"], radius: float) -> Float[np.ndarray, " n"]:
    """Return the distances of points from the ball of known radius that fits them best, positive outside of it."""
    away: Float[np.ndarray, " n"] = np.linalg.norm(points - fitted_ball(points, radius), axis=1) - radius
    return away
