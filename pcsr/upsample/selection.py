"""Lengths in which the gaps between new points are measured: by the density of the cloud and by predicted errors."""

import numpy as np
from jaxtyping import Float, Int

from pcsr.upsample.neighbours import Cloud, Neighbours

SMOOTHED = 32
"""Number of points over which the spacing is averaged for the density pattern."""
CHANCE = 0.1
"""Standard deviation of the logarithm of this average that random sampling causes. A cloud with less is even."""
PATTERN = 0.2
"""Standard deviation from which on the density pattern is preserved wholly."""
CAUTION = 2.0
"""Weight of a predicted error of one spacing in the choice of candidates."""


def pattern(cloud: Cloud, unit: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Compute the lengths in which new points near each point are to be equally far apart, up to a common factor.

    All are 1 if the spacing varies no more than that of random points. Otherwise they follow its average over the
    nearest points, so that dense regions stay denser by the same factor.

    Args:
        cloud: the points, (n 3).
        unit: the local spacing at each point, (n).
    """
    nearest = Neighbours.of(cloud, SMOOTHED).index[:, :SMOOTHED]
    logarithm = np.log(np.maximum(unit, np.finfo(float).tiny))[nearest].mean(1)
    share = np.clip((logarithm.std() - CHANCE) / (PATTERN - CHANCE), 0, 1)
    lengths: Float[np.ndarray, " n"] = np.exp(share * (logarithm - logarithm.mean()))
    return lengths


def caution(
    errors: Float[np.ndarray, " c"], nearest: Int[np.ndarray, " c"], unit: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " c"]:
    """Compute factors for the lengths of candidates, the larger the farther they are expected from the surface.

    A candidate of twice the length must be twice as far from all others to be chosen. The factors are relative to the
    mean around: regions where all errors are large get no fewer points.

    Args:
        errors: predicted distance of each candidate from the surface, (c).
        nearest: index of the point nearest to each candidate, (c).
        unit: the local spacing at each point, (n).
    """
    if not errors.any():
        return np.ones(len(errors))
    own = unit[nearest]
    factor = 1 + CAUTION * np.divide(errors, own, out=np.zeros(len(errors)), where=own > 0)
    count = np.maximum(np.bincount(nearest, minlength=len(unit)), 1)
    relative: Float[np.ndarray, " c"] = factor / (np.bincount(nearest, factor, len(unit)) / count)[nearest]
    return relative
