"""Wires: parts of a cloud whose points lie along a line, where candidates are on the chords between neighbours."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from pcsr.upsample.neighbours import Cloud, Neighbours

AROUND = 8
"""Number of nearest points, besides itself, that tell whether a point is on a wire."""
THIN = 0.07
"""Ratio of the second largest to the largest variance of these points, below which a point is on a wire."""
ALONG = 4
"""Number of nearest neighbours to which chords are drawn."""
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2)
"""Positions of candidates on a chord."""


def on_wires(cloud: Cloud) -> Bool[np.ndarray, " n"]:
    """Find the points that lie along a line with their neighbours.

    Args:
        cloud: the points, (n 3), in any frame.
    """
    neighbours = Neighbours.of(cloud, AROUND + 1)
    points, nearest = neighbours.points, neighbours.index[:, : AROUND + 1]
    offsets = points[nearest] - points[nearest].mean(1, keepdims=True)
    variances = np.linalg.eigvalsh(offsets.mT @ offsets)
    ratio = np.divide(variances[:, 1], variances[:, 2], out=np.ones(len(points)), where=variances[:, 2] > 0)
    thin: Bool[np.ndarray, " n"] = np.median(ratio[nearest], axis=1) < THIN
    return thin


def chords(points: Float[np.ndarray, "n 3"], wire: Bool[np.ndarray, " n"]) -> Float[np.ndarray, "c 3"]:
    """Generate candidates between each point of a wire and its neighbours on it.

    Args:
        points: the cloud, (n 3), in any frame.
        wire: the points on wires, (n).
    """
    here = points[wire]
    if len(here) < 2:
        return np.zeros((0, 3))
    index = cKDTree(here).query(here, k=range(2, min(ALONG, len(here) - 1) + 2))[1]
    offsets = here[index] - here[:, None]
    every = np.stack([here[:, None] + share * offsets for share in SHARES])
    candidates: Float[np.ndarray, "c 3"] = every.reshape(-1, 3)
    return candidates
