"""Expected error of each touched point after the registration."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from pcsr.registration.fit import Posterior
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import moved, moved_back

MOST_POINTS = 2048
"""Largest number of points that errors are computed for; further ones have the errors of the nearest of these."""


def point_errors(likelihood: Likelihood, after: Posterior, points: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, " m"]:
    """Compute the expected error of touched points, one standard deviation, in millimetres.

    The true surface is known in two ways: as the touched surface, wherever the distribution of the motion puts it, and
    at the points of the cloud that lie on it. The error is the distance from the nearer of both. So sliding along a
    surface does no harm except at the border of the contact, and there only where the cloud has no points.

    Args:
        likelihood: of the touch's motion.
        after: distribution of the motion.
        points: touched points in the frame of the touch, as reported.
    """
    if len(points) > MOST_POINTS:
        some = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
        nearest = cKDTree(points[some]).query(points)[1]
        few: Float[np.ndarray, " m"] = point_errors(likelihood, after, points[some])[nearest]
        return few
    here = moved(points, after.motion)
    likely = after.weights > 1e-3 * after.weights.max()
    back = moved_back(here, after.particles[likely])
    least = np.linalg.norm(back - points, axis=2)
    for surface in likelihood.surfaces:
        least = np.minimum(least, np.hypot(*surface.find(back)))
    terms = likelihood.terms(after.motion[None], np.array([after.deviation]))
    on: Bool[np.ndarray, " n"] = terms.share[0] > 0.5
    if on.any():
        least = np.minimum(least, cKDTree(likelihood.points[on]).query(here)[0])
    noise = max((surface.noise for surface in likelihood.surfaces), default=0.0)
    weights = after.weights[likely] / after.weights[likely].sum()
    errors: Float[np.ndarray, " m"] = np.sqrt(weights @ least**2 + noise**2)
    return errors
