"""Likelihood of a touch's pose, given the points of the cloud around it.

A point of the cloud lies on the touched surface, or somewhere else. Its density is a mixture: a normal distribution
across the surface, and a constant background. Where the finger was, the background is almost zero: what the finger
filled is empty. Relative to the background alone, the logarithm of the mixture says for or against a pose.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from scipy.special import gammaln

from pcsr.registration.motions import Motions, moved_back
from pcsr.registration.surface import TouchedSurface

SLOPE = 0.5
"""Growth of the surface's deviation beyond the contact, where it is extrapolated, per unit of length."""
IN_FINGER = 0.01
"""Background where the finger was, relative to that elsewhere."""
W_OUT = 0.0
FINGER = 10.0
DENSITY = 0.67
"""Depth of the finger above its contact, in millimetres."""


@dataclass(frozen=True)
class Terms:
    """Terms of the likelihood: of s motions and n points."""

    against: Float[np.ndarray, "s n"]
    """Logarithm of the probability of each point, at most 0: low for a point where the finger was."""
    share: Float[np.ndarray, "s n"]
    """Probability that the point lies on the touched surface."""
    precision: Float[np.ndarray, "s n"]
    """That probability, divided by the point's variance across the surface."""
    distance: Float[np.ndarray, "s n"]
    """Signed distance from the touched surface, in millimetres, positive towards the finger."""
    jacobian: Float[np.ndarray, "s n 6"]
    """Derivative of the distance with respect to the motion."""
    inside: Float[np.ndarray, "s n"]
    """1 in front of or behind the contact, 0 beside it."""


@dataclass(frozen=True)
class Likelihood:
    """Points of the cloud around one touch, and what the touch says of each."""

    surfaces: Sequence[TouchedSurface]
    """Touched surface of each finger, in the frame of the touch."""
    points: Float[np.ndarray, "n 3"]
    """Points of the cloud, in the frame of the touch, in millimetres."""
    variances: Float[np.ndarray, " n"]
    """Known variance of each point across the surface, besides that of the cloud."""
    thickness: float
    """Length over which the background is spread, in millimetres: the spacing of the cloud."""

    def terms(self, motions: Motions, deviation: Float[np.ndarray, " s"]) -> Terms:
        """Evaluate motions of the touch.

        Args:
            motions: (s 6), in the frame of the touch.
            deviation: standard deviation of the cloud's points from the surface, for each motion.
        """
        rotations = Rotation.from_rotvec(motions[:, :3]).as_matrix()
        back = moved_back(self.points, motions)
        found = [self._of(surface, back, deviation) for surface in self.surfaces]
        against, share, variance, distance, normal, inside = (np.stack(parts) for parts in zip(*found, strict=True))
        best = share.argmax(0)[None]
        share, variance, distance = (np.take_along_axis(one, best, 0)[0] for one in (share, variance, distance))
        normal = np.take_along_axis(normal, best[..., None], 0)[0] @ rotations.transpose(0, 2, 1)
        arm = self.points - motions[:, None, 3:]
        jacobian = -np.concatenate([np.cross(arm, normal), normal], axis=2)
        return Terms(against.sum(0), share, share / variance, distance, jacobian, inside.max(0))

    def _of(
        self, surface: TouchedSurface, back: Float[np.ndarray, "s n 3"], deviation: Float[np.ndarray, " s"]
    ) -> tuple[np.ndarray, ...]:
        distance, normal, outside, above = surface.distances(back)
        near = np.isfinite(outside)
        outside = np.where(near, outside, 0.0)
        sure = deviation[:, None] ** 2 + self.variances
        variance = sure + (SLOPE * outside) ** 2
        on = sum(w * np.exp(-(distance**2) / (2 * one)) / np.sqrt(2 * np.pi * one) for w, one in ((0.9, sure), (0.1, variance)))
        on = self.thickness * near * on
        inside = near & (outside == 0)
        known = np.isfinite(above) & ~inside & near
        on = np.where(known, W_OUT * on, on)
        background = np.ones_like(on)
        if surface.oriented:
            background[inside & (distance > 0) & (distance < FINGER)] = IN_FINGER
            background[known & (above > deviation[:, None]) & (above < FINGER)] = IN_FINGER
        return np.minimum(0, np.log(on + background)), on / (on + background), variance, distance, normal, inside.astype(float)

    def log(self, terms: Terms) -> Float[np.ndarray, " s"]:
        """Return the logarithm of the likelihood of each motion.

        Points where the finger was speak against a motion, and so do too few points on the touched surface.
        """
        expected = DENSITY / self.thickness**2 * sum(surface.area for surface in self.surfaces)
        found = np.minimum((terms.share * terms.inside).sum(1), expected)
        few = found * np.log(expected) - gammaln(found + 1)
        logarithm: Float[np.ndarray, " s"] = terms.against.sum(1) + few
        return logarithm
