"""Likelihood of a touch's motion, given the points of the cloud around it.

A point of the cloud lies on the touched surface or somewhere else. Its density is a mixture: a normal distribution
across the surface, and a constant background. Where the finger was, the background is almost zero, since what the
finger filled is empty. The number of points on the touched surface counts too: it is known how many to expect.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from scipy.special import gammaln, xlogy

from pcsr.registration.motions import Motions, carried
from pcsr.registration.surface import TouchedSurface

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
    density: Float[np.ndarray, "s n"]
    """Density of the point relative to the background, at most 1: low where the finger was."""
    inside: Float[np.ndarray, "s n"]
    """`share` of the points in front of or behind the contact; 0 beside it."""
    squared: Float[np.ndarray, "s n"]
    """Squared distance from the touched surface, in square millimetres."""
    information: Float[np.ndarray, "s 6 6"]
    """Information about the motion: of each point the outer product of the distance's derivative, times its `share`,
    divided by the variance across the surface."""
    gradient: Float[np.ndarray, "s 6"]
    """The same with the product of the derivative and the distance."""

    @property
    def against(self) -> Float[np.ndarray, "s n"]:
        """Logarithm of `density`."""
        against: Float[np.ndarray, "s n"] = np.log(self.density)
        return against


@dataclass(frozen=True)
class _Part:
    """Terms of one finger's surface, with the moments still to be summed over the points."""

    share: Float[np.ndarray, "s n"]
    density: Float[np.ndarray, "s n"]
    inside: Float[np.ndarray, "s n"]
    squared: Float[np.ndarray, "s n"]
    weights: Float[np.ndarray, "s n"]
    """Weight of each point in the moments."""
    rows: Float[np.ndarray, "s 7 n"]
    """Derivative of the height above the tangent plane with respect to the motion, and the height."""
    frames: Float[np.ndarray, "s 6 6"]
    """Matrices that express motions in the frame of the surface, with the sign of the derivative."""


@dataclass(frozen=True)
class Likelihood:
    """Points of the cloud around one touch, and what the touch says of each. Lengths are in millimetres."""

    surfaces: Sequence[TouchedSurface]
    """Touched surface of each finger, in the frame of the touch."""
    points: Float[np.ndarray, "n 3"]
    """Points of the cloud, and of other touches after them, in the frame of the touch."""
    spacing: float
    """Mean distance of the cloud's points to their four nearest. The background is spread over this length."""
    others: Float[np.ndarray, " k"] = field(default_factory=lambda: np.zeros(0))
    """Variances of the last points, which are of other touches."""

    @property
    def of_cloud(self) -> int:
        """Number of points of the cloud."""
        return len(self.points) - len(self.others)

    def terms(self, motions: Motions, deviation: Float[np.ndarray, " s"]) -> Terms:
        """Evaluate motions of the touch.

        Args:
            motions: (s 6), in the frame of the touch.
            deviation: standard deviation of the cloud's points from the surface, for each motion.
        """
        rotations = Rotation.from_rotvec(motions[:, :3]).as_matrix()
        parts = [self._part(surface, motions[:, 3:], rotations, deviation) for surface in self.surfaces]
        if len(parts) > 1:
            parts = _divided(parts)
        information = np.zeros((len(motions), 6, 6))
        gradient = np.zeros((len(motions), 6))
        if not parts:
            none = np.zeros((len(motions), len(self.points)))
            return Terms(none, none + 1, none, none, information, gradient)
        for part in parts:
            moments = (part.rows * part.weights[:, None]) @ part.rows.transpose(0, 2, 1)
            back = part.frames.transpose(0, 2, 1)
            information += back @ moments[:, :6, :6] @ part.frames
            gradient += (back @ moments[:, :6, 6:])[..., 0]
        first = parts[0]
        share, density, inside, squared = first.share, first.density, first.inside, first.squared
        for part in parts[1:]:
            share, inside = share + part.share, inside + part.inside
            density, squared = density * part.density, squared + part.squared
        return Terms(share, density, inside, squared, information, gradient)

    def _part(
        self,
        surface: TouchedSurface,
        translations: Float[np.ndarray, "s 3"],
        rotations: Float[np.ndarray, "s 3 3"],
        deviation: Float[np.ndarray, " s"],
    ) -> _Part:
        """Evaluate motions by the surface of one finger, in its frame."""
        turned = (rotations @ surface.axes).transpose(0, 2, 1)
        local = turned @ self.points.T
        local -= turned @ translations[..., None] + (surface.origin @ surface.axes)[:, None]
        x, y, z = local[:, 0], local[:, 1], local[:, 2]
        planes = surface.planes(x, y, z)
        level = deviation[:, None]
        variance = planes.widening + level**2
        variance[:, self.of_cloud :] += self.others
        squared = planes.height**2 * planes.flatness
        on = self.spacing / np.sqrt(2 * np.pi * variance) * np.exp(-0.5 * squared / variance)
        contact = planes.level == -np.inf
        density = on.copy()
        if surface.oriented:
            above = np.where(contact, planes.height * np.sqrt(planes.flatness), z - planes.level)
            in_finger = (above > np.where(contact, 0.0, level)) & (above < FINGER)
            density += np.where(in_finger, IN_FINGER, 1.0)
        else:
            density += 1.0
        share = on / density
        rows = np.zeros((len(x), 7, x.shape[1]))
        rows[:, 0] = y + z * planes.slope_y
        rows[:, 1] = -x - z * planes.slope_x
        rows[:, 2] = y * planes.slope_x - x * planes.slope_y
        rows[:, 3] = -planes.slope_x
        rows[:, 4] = -planes.slope_y
        rows[:, 5] = 1.0
        rows[:, 6] = planes.height
        frames = np.zeros((len(x), 6, 6))
        frames[:, :3, :3] = frames[:, 3:, 3:] = rotations.transpose(0, 2, 1)
        frames = -carried(surface.axes, surface.origin) @ frames
        weights = share / variance * planes.flatness
        return _Part(share, np.minimum(density, 1.0), share * contact, squared, weights, rows, frames)

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
        few = xlogy(found, self.expected) - gammaln(found + 1)
        logarithm: Float[np.ndarray, " s"] = terms.against.sum(1) + few
        return logarithm


def _divided(parts: Sequence[_Part]) -> list[_Part]:
    """Divide the points among the fingers: each belongs to the surface on which it lies most likely."""
    owner = np.argmax([part.share for part in parts], axis=0)
    divided = []
    for number, part in enumerate(parts):
        mine = owner == number
        divided.append(
            replace(
                part,
                share=part.share * mine,
                inside=part.inside * mine,
                squared=part.squared * mine,
                weights=part.weights * mine,
            )
        )
    return divided
