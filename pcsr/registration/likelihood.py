"""Likelihood of a touch's motion, given the points of the cloud around it.

A point of the cloud lies on the touched surface or somewhere else. Its density is a mixture: a normal distribution
across the surface, and a constant background. Where the finger was, the background is almost zero, since what the
finger filled is empty. The number of points on the touched surface counts too: it is known how many to expect.
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
FINGER = 10.0
"""Depth of the finger above its contact, in millimetres."""
DENSITY = 0.67
"""Points per area of a random cloud whose mean distance to the four nearest points is 1."""


@dataclass(frozen=True)
class Terms:
    """Terms of the likelihood of s motions and n points."""

    share: Float[np.ndarray, "s n"]
    """Probability that the point lies on the touched surface."""
    against: Float[np.ndarray, "s n"]
    """Logarithm of the point's density where the finger was, relative to the background elsewhere; at most 0."""
    inside: Float[np.ndarray, "s n"]
    """`share` of the points in front of or behind the contact; 0 beside it."""
    precision: Float[np.ndarray, "s n"]
    """`share`, divided by the point's variance across the surface."""
    distance: Float[np.ndarray, "s n"]
    """Signed distance from the touched surface, in millimetres, positive towards the finger."""
    jacobian: Float[np.ndarray, "s n 6"]
    """Derivative of the distance with respect to the motion."""


@dataclass(frozen=True)
class Likelihood:
    """Points of the cloud around one touch, and what the touch says of each. Lengths are in millimetres."""

    surfaces: Sequence[TouchedSurface]
    """Touched surface of each finger, in the frame of the touch."""
    points: Float[np.ndarray, "n 3"]
    """Points of the cloud, in the frame of the touch."""
    spacing: float
    """Mean distance of the cloud's points to their four nearest. The background is spread over this length."""

    def terms(self, motions: Motions, deviation: Float[np.ndarray, " s"]) -> Terms:
        """Evaluate motions of the touch.

        Args:
            motions: (s 6), in the frame of the touch.
            deviation: standard deviation of the cloud's points from the surface, for each motion.
        """
        back = moved_back(self.points, motions)
        rotations = Rotation.from_rotvec(motions[:, :3]).as_matrix()
        lever = self.points - motions[:, None, 3:]
        total: Terms | None = None
        for surface in self.surfaces:
            terms = self._of(surface, back, rotations, lever, deviation)
            total = terms if total is None else _joined(total, terms)
        assert total is not None
        return total

    def _of(
        self,
        surface: TouchedSurface,
        back: Float[np.ndarray, "s n 3"],
        rotations: Float[np.ndarray, "s 3 3"],
        lever: Float[np.ndarray, "s n 3"],
        deviation: Float[np.ndarray, " s"],
    ) -> Terms:
        found = surface.find(back)
        near = np.isfinite(found.outside)
        outside = np.where(near, found.outside, 0.0)
        inside = near & (outside == 0)
        variance = deviation[:, None] ** 2 + (SLOPE * outside) ** 2
        on = self.spacing / np.sqrt(2 * np.pi * variance) * np.exp(-0.5 * found.distance**2 / variance)
        # Beside the contact, but in the sensor's view, the surface is not where the contact would continue.
        on *= near & (inside | (found.above == -np.inf))
        in_finger = (found.above > np.where(inside, 0.0, deviation[:, None])) & (found.above < FINGER)
        background = np.where(in_finger, IN_FINGER, 1.0)
        share = on / (on + background)
        normal = np.concatenate([-found.slopes, np.ones((*share.shape, 1))], axis=-1)
        normal /= np.sqrt(1 + (found.slopes**2).sum(-1))[..., None]
        normal = normal @ (rotations @ surface.axes).transpose(0, 2, 1)
        jacobian = np.zeros((*share.shape, 6))
        jacobian[..., 0] = lever[..., 2] * normal[..., 1] - lever[..., 1] * normal[..., 2]
        jacobian[..., 1] = lever[..., 0] * normal[..., 2] - lever[..., 2] * normal[..., 0]
        jacobian[..., 2] = lever[..., 1] * normal[..., 0] - lever[..., 0] * normal[..., 1]
        jacobian[..., 3:] = -normal
        against = np.minimum(0.0, np.log(on + background))
        return Terms(share, against, share * inside, share / variance, found.distance, jacobian)

    @property
    def expected(self) -> float:
        """Expected number of points on the touched surface."""
        return DENSITY / self.spacing**2 * sum(surface.area for surface in self.surfaces)

    def log(self, terms: Terms) -> Float[np.ndarray, " s"]:
        """Return the logarithm of the likelihood of each motion.

        Points where the finger was speak against a motion, and so do fewer points on the touched surface than the
        density of the cloud leads to expect.
        """
        found = np.minimum(terms.inside.sum(1), self.expected)
        few = found * np.log(self.expected) - gammaln(found + 1)
        logarithm: Float[np.ndarray, " s"] = terms.against.sum(1) + few
        return logarithm


def _joined(one: Terms, other: Terms) -> Terms:
    """Join the terms of two fingers: each point belongs to the surface on which it lies more likely."""
    first = one.share >= other.share

    def chosen(name: str) -> Float[np.ndarray, "s n *k"]:
        mine: Float[np.ndarray, "s n *k"] = getattr(one, name)
        others: Float[np.ndarray, "s n *k"] = getattr(other, name)
        return np.where(first if mine.ndim == 2 else first[..., None], mine, others)

    return Terms(
        chosen("share"),
        one.against + other.against,
        chosen("inside"),
        chosen("precision"),
        chosen("distance"),
        chosen("jacobian"),
    )
