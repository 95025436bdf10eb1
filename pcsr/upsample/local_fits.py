"""Quadrics fitted to the neighbourhoods of points, with the residual and the variance of the fit at each neighbour."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

TERMS = 6
"""Number of coefficients of a quadric."""
ROUNDS = 3
"""Number of least-squares fits, each without the neighbours that are off the one before."""
CUT = 3.0
"""A neighbour farther off than this, in standard deviations of the noise, is not fitted."""
RIDGE = 1e-6
"""Weight of small coefficients, which makes fits to collinear points possible."""


def quadric_terms(u: Float[np.ndarray, "n k"], v: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n k 6"]:
    """Return the terms of a quadric at tangential coordinates: 1, the coordinates, and their products."""
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)


@dataclass(frozen=True)
class LocalFits:
    """Quadric fitted to each of n neighbourhoods of k points: a height over the tangent plane.

    The method is that of Cazals and Pouget, "Estimating differential quantities using polynomial fitting of osculating
    jets" (SGP 2003).
    """

    residual: Float[np.ndarray, "n k"]
    """Signed distance of each neighbour from the quadric, along the quadric's normal there."""
    normal: Float[np.ndarray, "n k 3"]
    """Unit normal of the quadric at each neighbour."""
    leverage: Float[np.ndarray, "n k"]
    """Variance of the fitted height at each neighbour, in variances of the noise."""
    fitted: Bool[np.ndarray, "n k"]
    """Which neighbours the quadric was fitted to at last."""

    @classmethod
    def of(
        cls, offsets: Float[np.ndarray, "n k 3"], chosen: Bool[np.ndarray, "n k"] | None = None, level: float = np.inf
    ) -> "LocalFits":
        """Fit the quadrics.

        Args:
            offsets: neighbours of each point, relative to it.
            chosen: which neighbours are fitted; all by default.
            level: standard deviation of the noise, beyond `CUT` times which neighbours are left out.
        """
        chosen = np.ones(offsets.shape[:2], bool) if chosen is None else chosen
        count = np.maximum(chosen.sum(1), 1)[:, None, None]
        centred = (offsets - (offsets * chosen[..., None]).sum(1, keepdims=True) / count) * chosen[..., None]
        axes = np.linalg.eigh(centred.mT @ centred)[1]
        height, *across = np.moveaxis(offsets @ axes, -1, 0)
        unit = np.sqrt(np.square(across).sum(0).mean(1, keepdims=True))
        u, v = (np.divide(one, unit, out=np.zeros_like(one), where=unit > 0) for one in across)
        terms = quadric_terms(u, v)
        fitted, residual = chosen, np.zeros(chosen.shape)
        for _ in range(ROUNDS if level < np.inf else 1):
            fitted = chosen & (np.abs(residual) < CUT * level)
            weighted = (terms * fitted[..., None]).mT
            inverse = np.linalg.inv(weighted @ terms + RIDGE * np.eye(TERMS))
            coefficients = inverse @ (weighted @ height[..., None])
            residual = height - (terms @ coefficients)[..., 0]
        _, a, b, c, d, e = np.moveaxis(coefficients, 1, 0)
        unit = np.where(unit > 0, unit, 1)
        slopes = np.stack([np.ones_like(u), -(a + 2 * c * u + d * v) / unit, -(b + d * u + 2 * e * v) / unit], axis=-1)
        length = np.linalg.norm(slopes, axis=-1)
        leverage = ((terms @ inverse) * terms).sum(-1)
        return cls(residual / length, slopes / length[..., None] @ axes.mT, leverage, fitted)
