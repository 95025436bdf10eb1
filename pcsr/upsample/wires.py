"""Wires: parts of a cloud whose points lie along a line, where candidates are on the chords between neighbours."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

AROUND = 8
"""Number of nearest points, besides itself, that tell whether a point is on a wire."""
THIN = 0.07
"""Ratio of the second largest to the largest variance of these points, below which a point is on a wire."""
ALONG = 4
"""Number of nearest neighbours to which chords are drawn."""
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2)
"""Positions of candidates on a chord."""


def on_wires(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Find the points that lie along a line with their neighbours.

    Args:
        points: the cloud, (n 3), in any frame.
    """
    nearest = cKDTree(points).query(points, k=min(AROUND + 1, len(points)))[1]
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
    if not wire.any():
        return np.zeros((0, 3))
    here = points[wire]
    index = (
        cKDTree(here).query(here, k=range(2, min(ALONG, len(here) - 1) + 2))[1]
        if len(here) > 1
        else np.zeros((1, 0), int)
    )
    offsets = here[index] - here[:, None]
    candidates: Float[np.ndarray, "c 3"] = np.concatenate(
        [here[:, None] + share * offsets for share in SHARES]
    ).reshape(-1, 3)
    return candidates
