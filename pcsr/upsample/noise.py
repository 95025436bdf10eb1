"""Noise of a cloud: its level, and displacement of new points onto the surface that is fitted to noisy points.

Around each point a quadric is fitted to its nearest points, a height over the tangent plane (Cazals and Pouget,
"Estimating differential quantities using polynomial fitting of osculating jets", SGP 2003). The residuals are noise
where the neighbourhood is flat; elsewhere they may be details that the cloud is too sparse for.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

AROUND = 16
"""Number of points that a quadric is fitted to."""
TERMS = 6
"""Number of coefficients of a quadric."""
LITTLE, MUCH = 0.08, 0.16
"""Levels of noise, in spacings: up to the first new points stay where they are, from the second on they are displaced
wholly."""
ALIKE, UNLIKE = 1.5, 1.8
FLAT, BENT = 0.05, 0.09
"""Ratios of the smallest to the largest variance of a neighbourhood: noise is told from details up to the first, and
not at all from the second on."""
RIDGE = 1e-6
"""Weight of small coefficients, in squared spacings, which makes fits to collinear points possible."""


@dataclass(frozen=True)
class Quadrics:
    """Quadric at each point of a cloud: a height over two tangents, in the unit of the local spacing."""

    points: Float[np.ndarray, "n 3"]
    unit: Float[np.ndarray, " n"]
    axes: Float[np.ndarray, "n 3 3"]
    """The normal and two tangents, as columns."""
    coefficients: Float[np.ndarray, "n 6"]
    residual: Float[np.ndarray, " n"]
    """Standard deviation of the points around the quadric."""
    flatness: Float[np.ndarray, " n"]
    """Ratio of the smallest to the largest variance of the neighbourhood."""

    @classmethod
    def fit(cls, points: Float[np.ndarray, "n 3"], unit: Float[np.ndarray, " n"]) -> "Quadrics":
        """Fit a quadric to the nearest points of each point.

        Args:
            points: the cloud, (n 3), in any frame; more than `TERMS`.
            unit: the local spacing at each point, (n), positive.
        """
        k = min(AROUND, len(points))
        index = cKDTree(points).query(points, k=k)[1]
        offsets = (points[index] - points[:, None]) / unit[:, None, None]
        centred = offsets - offsets.mean(1, keepdims=True)
        variances, axes = np.linalg.eigh(centred.mT @ centred)
        local = offsets @ axes
        terms = _terms(local)
        system = terms.mT @ terms + RIDGE * np.eye(TERMS)
        coefficients = np.linalg.solve(system, terms.mT @ local[..., :1])
        rest = local[..., :1] - terms @ coefficients
        residual = np.sqrt(np.square(rest).sum((1, 2)) / (k - TERMS))
        flatness = np.divide(variances[:, 0], variances[:, 2], out=np.ones(len(points)), where=variances[:, 2] > 0)
        return cls(points, unit, axes, coefficients[..., 0], residual, flatness)

    def level(self) -> float:
        """Return the level of noise, in spacings: the lower quartile of the residuals, for some regions are detailed."""
        return float(np.quantile(self.residual, 0.25))

    def evenness(self) -> float:
        low, high = np.quantile(self.residual, [.25, .75])
        return float(high / low) if low > 0 else np.inf

    def displaced(self, new: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
        """Return new points displaced onto the quadric of the nearest point, as far as there is noise."""
        share = np.clip((self.level() - LITTLE) / (MUCH - LITTLE), 0, 1) * np.clip((UNLIKE - self.evenness()) / (UNLIKE - ALIKE), 0, 1) * np.clip((BENT - np.median(self.flatness)) / (BENT - FLAT), 0, 1)
        if share == 0 or len(new) == 0:
            return new
        nearest = cKDTree(self.points).query(new)[1]
        share = share * np.clip((BENT - self.flatness[nearest]) / (BENT - FLAT), 0, 1)
        axes, unit = self.axes[nearest], self.unit[nearest, None]
        local = ((new - self.points[nearest]) / unit)[:, None] @ axes
        height = (_terms(local)[:, 0] * self.coefficients[nearest]).sum(-1) - local[:, 0, 0]
        moved: Float[np.ndarray, "m 3"] = new + (share * height)[:, None] * unit * axes[..., 0]
        return moved


def _terms(local: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, "n k 6"]:
    """Return the terms of a quadric: 1, the tangential coordinates, and their products."""
    u, v = local[..., 1], local[..., 2]
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
