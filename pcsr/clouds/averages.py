"""Weighted means of columns over neighbouring points: of numbers, and of directions and quaternions."""

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial import KDTree

AGREE = 0.5
"""Smallest cosine of the angle between the nearest direction, taken without its sign, and another that is averaged
with it: 60°."""


def weighted_neighbours(
    tree: KDTree, points: Float64[np.ndarray, "m 3"], k: int
) -> tuple[Int[np.ndarray, "m k"], Float64[np.ndarray, "m k"]]:
    """Return the indices of the nearest old points, nearest first, and their weights relative to the nearest."""
    distance, neighbours = tree.query(points, k=range(1, k + 1), workers=-1)
    first = distance[:, :1]
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = first / distance
    # Where a new point coincides with an old one, the others get no weight.
    weight[:] = np.where(first > 0, weight, 0.0)
    weight[:, 0] = 1.0
    return neighbours, weight


def mean(
    column: np.ndarray, neighbours: Int[np.ndarray, "m k"], weight: Float64[np.ndarray, "m k"], *, whole: bool
) -> np.ndarray:
    """Compute weighted means of a column over neighbours, in the column's type.

    Args:
        column: (n,) or (n, c).
        neighbours: rows of the column, nearest first.
        weight: weights of the neighbours.
        whole: round the means.
    """
    nearest = column[neighbours[:, 0]]
    shares = (weight / weight.sum(axis=1, keepdims=True)).reshape(weight.shape + (1,) * (column.ndim - 1))
    with np.errstate(invalid="ignore", over="ignore"):
        values = column[neighbours].astype(np.float64)
        # Computed as a difference to the nearest value, so that constant columns stay exactly constant.
        average = values[:, 0] + (shares * (values - values[:, :1])).sum(axis=1)
        if whole:
            average = np.rint(average)
        if column.dtype.kind in "iu":
            kind = np.iinfo(column.dtype)
            average = average.clip(kind.min, kind.max)
        copied = _only_nearest(weight).reshape(-1, *(1 for _ in column.shape[1:])) | ~np.isfinite(average)
        result: np.ndarray = np.where(copied, nearest, average.astype(column.dtype))
    return result


def mean_direction(
    directions: Float[np.ndarray, "n c"], neighbours: Int[np.ndarray, "m k"], weight: Float64[np.ndarray, "m k"]
) -> Float[np.ndarray, "m c"]:
    """Compute weighted mean directions of length 1, or mean quaternions, over neighbours.

    Each direction gets the sign that is nearer to the nearest point's, since many tools give normals random signs, and
    a quaternion and its negative are the same rotation. Directions farther from it than `AGREE` are left out: they
    belong to another face. The nearest is returned as it is where it has no length.

    Args:
        directions: vectors of any length.
        neighbours: rows of the directions, nearest first.
        weight: weights of the neighbours.
    """
    nearest = directions[neighbours[:, 0]]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        values = directions[neighbours].astype(np.float64)
        values /= np.linalg.norm(values, axis=2, keepdims=True)
        cosine = (values * values[:, :1]).sum(axis=2)
        used = np.abs(cosine) >= AGREE
        signed = np.where(used, weight * np.sign(cosine), 0.0)
        total = (signed[..., None] * np.where(used[..., None], values, 0.0)).sum(axis=1)
        average = total / np.linalg.norm(total, axis=1, keepdims=True)
    copied = _only_nearest(weight)[:, None] | ~np.isfinite(average).all(axis=1, keepdims=True)
    result: Float[np.ndarray, "m c"] = np.where(copied, nearest, average)
    return result


def _only_nearest(weight: Float64[np.ndarray, "m k"]) -> Bool[np.ndarray, " m"]:
    """Return where all weights but that of the nearest point are 0."""
    only: Bool[np.ndarray, " m"] = (weight[:, 1:] == 0).all(axis=1)
    return only
