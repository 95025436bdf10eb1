"""Estimate of the noise of a cloud, from the residuals of quadrics that are fitted to neighbourhoods."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree
from scipy.special import gammaincinv

from pcsr.threads import threads
from pcsr.upsample.local_fits import TERMS, LocalFits
from pcsr.upsample.neighbours import SPACED

SIZES = ((16, 24, 48), (32, 48, 96), (64, 96, 128))
"""Numbers of points that quadrics are fitted to: the first three whose neighbourhoods are wide beside the noise. The
first two give the level; the third shows whether it grows."""
WIDE = 6.0
"""Radius of a wide neighbourhood, in standard deviations of the noise."""
QUANTILES = (0.05, 0.1)
"""Quantiles of the residuals that are compared with those of noise. At edges and details, residuals are larger."""
SAMPLE = 20_000
"""Largest number of neighbourhoods by default, evenly spread over the rows."""
BATCH = 2048
"""Number of neighbourhoods that are fitted at once. It bounds the memory."""
LEAST = 0.05
"""Lower levels, in spacings, are taken for details of a clean cloud."""
GROWTH = 1.9
"""Larger ratios of the levels of the third and the first neighbourhoods are due to details: noise has the same in both.
"""
KURTOSIS = 2.45
"""Smaller kurtosis of the residuals is due to thin sheets, on both sides of which points lie. That of Gaussian noise is
2.6."""


@threads(1)
def noise_level(points: Float[np.ndarray, "n 3"], sample: int = SAMPLE) -> float:
    """Estimate the standard deviation of the noise across the surface.

    In neighbourhoods without edges and details, the sum of the squared residuals divided by the variance of the noise
    follows a chi-square distribution; in others it is larger. So each quantile of the sums gives an upper limit of the
    noise, and the smallest limit is the estimate. It is 0 where the residuals are rather those of details: they grow
    with the neighbourhood, are on two sides as in thin sheets, or are tiny.

    Args:
        points: the cloud, (n 3), without duplicates. A sample is taken at equal steps of the rows, so that their order
            should follow from the coordinates.
        sample: largest number of neighbourhoods.

    Returns:
        The level in the unit of the cloud; 0 if there is none that differs from details, or fewer than 48 points.
    """
    tree, level = cKDTree(points), 0.0
    for sizes in SIZES:
        if len(points) < sizes[-1]:
            break
        found = _Residuals.of(points, tree, sizes, sample)
        if found.of_sheets() or (level == 0 and found.of_details()):
            return 0.0
        level = found.limits[:2].min()
        if np.pi * (WIDE * level / found.spacing) ** 2 <= sizes[0]:  # about the number of points within that radius
            break
    return float(level)


@dataclass(frozen=True)
class _Residuals:
    """Residuals of quadrics in neighbourhoods of three sizes of a sample of the points."""

    spacing: float
    """Median spacing of the points."""
    limits: Float[np.ndarray, "3 q"]
    """Upper limits of the noise for each of the sizes and quantiles."""
    kurtosis: Float[np.ndarray, "3"]
    """Median kurtosis for each of the sizes."""

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"], tree: cKDTree, sizes: Sequence[int], sample: int) -> "_Residuals":
        rows = np.unique(np.linspace(0, len(points) - 1, min(sample, len(points))).round().astype(int))
        spacing, sums, kurtosis = np.zeros(len(rows)), np.zeros((3, len(rows))), np.full((3, len(rows)), 3.0)
        for start in range(0, len(rows), BATCH):
            batch = slice(start, start + BATCH)
            distance, index = tree.query(points[rows[batch]], k=sizes[-1])
            spacing[batch] = distance[:, 1 : SPACED + 1].mean(1)
            offsets = points[index] - points[rows[batch], None]
            for number, size in enumerate(sizes):
                squares = LocalFits.of(offsets[:, :size]).residual ** 2
                sums[number, batch] = squares.sum(1)
                mean = squares.mean(1)
                np.divide((squares**2).mean(1), mean**2, out=kurtosis[number, batch], where=mean > 0)
        limits = np.stack([_limits(each, size) for each, size in zip(sums, sizes, strict=True)])
        return cls(float(np.median(spacing)), limits, np.median(kurtosis, axis=1))

    def of_details(self) -> bool:
        """Return whether the residuals are tiny, or grow with the neighbourhood."""
        grows = self.limits[-1, -1] > GROWTH * self.limits[0, -1]
        return bool(grows or self.limits[:2].min() < LEAST * self.spacing)

    def of_sheets(self) -> bool:
        """Return whether points lie on both sides of the surfaces that are fitted."""
        return bool((self.kurtosis[1:] < KURTOSIS).any())


def _limits(sums: Float[np.ndarray, " n"], size: int) -> Float[np.ndarray, " q"]:
    """Return the noise with which each of the quantiles of the sums would be as it is."""
    chi_square = 2 * gammaincinv((size - TERMS) / 2, QUANTILES)
    limits: Float[np.ndarray, " q"] = np.sqrt(np.quantile(sums, QUANTILES) / chi_square)
    return limits
