"""Noise of a cloud: its level, and displacement of new points onto the surface that is fitted to noisy points.

Around each point a quadric is fitted to its nearest points, a height over the tangent plane (Cazals and Pouget,
"Estimating differential quantities using polynomial fitting of osculating jets", SGP 2003). The residuals are noise
where the neighbourhood is flat; elsewhere they may be details that the cloud is too sparse for.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.upsample.local_fits import RIDGE, TERMS, quadric_terms
from pcsr.upsample.neighbours import Cloud, Neighbours

AROUND = 16
"""Number of points that a quadric is fitted to."""
CLEAN, NOISY = (0.08, 1.8, 0.2), (0.16, 1.5, 0.1)
"""Evidence of noise from which on new points begin to be displaced, and with which they are displaced wholly.

It is the lower quartile of the residuals in spacings, the ratio of the upper to the lower quartile, and the median
flatness. Details that a cloud is too sparse for leave residuals too, but of different sizes, and where neighbourhoods
are not flat.
"""


@dataclass(frozen=True)
class Quadrics:
    """Quadric at each point of a cloud: a height over two tangents, in the unit of the local spacing."""

    neighbours: Neighbours
    """The cloud."""
    unit: Float[np.ndarray, " n"]
    """The local spacing at each point."""
    axes: Float[np.ndarray, "n 3 3"]
    """The normal and two tangents, as columns."""
    variances: Float[np.ndarray, "n 3"]
    """Sums of squares of the neighbourhood along the axes, around its mean; the smallest first."""
    local: Float[np.ndarray, "n k 3"]
    """Offsets to the neighbours along the axes."""

    @classmethod
    def fit(cls, cloud: Cloud, unit: Float[np.ndarray, " n"]) -> "Quadrics":
        """Fit a quadric to the nearest points of each point.

        Args:
            cloud: the points, (n 3), in any frame; more than `TERMS`.
            unit: the local spacing at each point, (n), positive.
        """
        neighbours = Neighbours.of(cloud, AROUND)
        points, index = neighbours.points, neighbours.index[:, :AROUND]
        offsets = (points[index] - points[:, None]) / unit[:, None, None]
        centred = offsets - offsets.mean(1, keepdims=True)
        variances, axes = np.linalg.eigh(centred.mT @ centred)
        return cls(neighbours, unit, axes, variances, offsets @ axes)

    @cached_property
    def _terms(self) -> Float[np.ndarray, "n k 6"]:
        return quadric_terms(self.local[..., 1], self.local[..., 2])

    @cached_property
    def coefficients(self) -> Float[np.ndarray, "n 6"]:
        """Coefficients of the terms 1, u, v, u², uv and v² of the tangential coordinates."""
        terms = self._terms
        system = terms.mT @ terms + RIDGE * np.eye(TERMS)
        solution: Float[np.ndarray, "n 6"] = np.linalg.solve(system, terms.mT @ self.local[..., :1])[..., 0]
        return solution

    @cached_property
    def residual(self) -> Float[np.ndarray, " n"]:
        """Standard deviation of the points around the quadric."""
        rest = self.local[..., 0] - (self._terms @ self.coefficients[..., None])[..., 0]
        return self._deviation(np.square(rest).sum(1))

    @cached_property
    def flatness(self) -> Float[np.ndarray, " n"]:
        """Ratio of the smallest variance of the neighbourhood to the second: large on wires and edges."""
        least, second = self.variances[:, 0], self.variances[:, 1]
        ratio: Float[np.ndarray, " n"] = np.divide(least, second, out=np.ones(len(least)), where=second > 0)
        return ratio

    def noisy(self) -> float:
        """Return how certain it is that the residuals are noise: 0 for a cloud without noise, or too sparse to tell."""
        around_planes = self._deviation(np.maximum(self.variances[:, 0], 0))  # no quadric leaves more
        if np.quantile(around_planes, 0.25) <= CLEAN[0]:
            return 0.0
        lower, upper = np.quantile(self.residual, [0.25, 0.75])
        evidence = lower, upper / lower if lower > 0 else np.inf, np.median(self.flatness)
        return float(np.prod([_share(value, *bounds) for value, *bounds in zip(evidence, CLEAN, NOISY, strict=True)]))

    def _deviation(self, squares: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the standard deviation that belongs to each sum of squared residuals."""
        deviation: Float[np.ndarray, " n"] = np.sqrt(squares / (self.local.shape[1] - TERMS))
        return deviation

    def displaced(self, new: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
        """Return new points displaced towards the quadric of the nearest point, as far as there is noise.

        Where the neighbourhood is not flat, as at edges, they stay.
        """
        certain = self.noisy()
        if certain == 0 or len(new) == 0:
            return new
        nearest = self.neighbours.tree.query(new)[1]
        share = certain * _share(self.flatness[nearest], CLEAN[2], NOISY[2])
        axes, unit = self.axes[nearest], self.unit[nearest, None]
        local = ((new - self.neighbours.points[nearest]) / unit)[:, None] @ axes
        terms = quadric_terms(local[..., 1], local[..., 2])[:, 0]
        height = (terms * self.coefficients[nearest]).sum(-1) - local[:, 0, 0]
        moved: Float[np.ndarray, "m 3"] = new + (share * height)[:, None] * unit * axes[..., 0]
        return moved


def _share(value: Any, none: float, everything: float) -> Any:
    """Return where a value lies on the way from `none` to `everything`, 0 to 1."""
    return np.clip((value - none) / (everything - none), 0, 1)
