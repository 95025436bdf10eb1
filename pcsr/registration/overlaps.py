"""Touches of a surface that the cloud does not show: the points of touches that overlap them count as its points.

Where the cloud shows the surface, they would add little, and a touch that fits in the wrong place would mislead others.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from pcsr.registration.likelihood import Likelihood
from pcsr.registration.neighbourhood import Neighbourhood

KEPT = 64
"""Largest number of points of a registered touch that count."""
COUNTED = 128
"""Largest number of points of other touches that count for one touch."""


@dataclass
class Overlaps:
    """Points of the touches that are registered already, in millimetres from the centroid of the cloud."""

    points: list[Float[np.ndarray, "k 3"]] = field(default_factory=list)
    errors: list[Float[np.ndarray, " k"]] = field(default_factory=list)
    """Expected error of each point."""

    def add(self, points: Float[np.ndarray, "m 3"], errors: Float[np.ndarray, " m"]) -> None:
        """Add the points of a registered touch."""
        some = np.random.default_rng(0).permutation(len(points))[:KEPT]
        self.points.append(points[some])
        self.errors.append(errors[some])

    def around(self, one: Neighbourhood, likelihood: Likelihood, margin: float) -> Likelihood:
        """Return the likelihood of a touch's motion with the points of the other touches around it.

        Args:
            one: the touch.
            likelihood: of its motion, given the cloud.
            margin: distance from the touch up to which others are looked at, in millimetres.
        """
        radius = float(np.linalg.norm(one.points, axis=1).max()) + margin
        points = np.concatenate([np.zeros((0, 3)), *self.points]) - one.origin
        away = np.linalg.norm(points, axis=1)
        near = np.flatnonzero(away <= radius)
        if len(near) == 0:
            return likelihood
        nearest = near[np.argsort(away[near], kind="stable")][:COUNTED]
        errors = np.concatenate(self.errors)[nearest]
        return replace(
            likelihood,
            points=np.concatenate([likelihood.points, points[nearest] @ one.axes]),
            others=errors**2,
        )
