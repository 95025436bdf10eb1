"""Interpolation of a cloud's columns (colours, normals, labels) at new points of the same surface."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial import KDTree

from pcsr.clouds.columns import colour_names, normal_groups
from pcsr.errors import UserError
from pcsr.geometry.magnitude import exponent, scaled

CHUNK = 1 << 18
"""New points that are processed at once: about 50 MB."""
CANCELLED = 1e-9
"""Normals cancel out if the length of their sum is less than this share of the longest."""


def carry(
    columns: Mapping[str, np.ndarray],
    old_points: Float[np.ndarray, "n 3"],
    new_points: Float[np.ndarray, "m 3"],
    k: int = 3,
) -> dict[str, np.ndarray]:
    """Interpolate the columns of a cloud at new points. Names, order and types of the columns are kept.

    - Floats and colours: mean of the `k` nearest old points, weighted by the inverse distance. Integer colours are
      rounded.
    - Normals: the same mean, scaled to length 1; the normal of the nearest old point where they cancel out.
    - Other integers and booleans, such as labels, and values without a finite mean: value of the nearest old point.

    A new point that coincides with an old one gets exactly its values.

    Args:
        columns: arrays (n,) or (n, c) by name.
        old_points: points of the columns.
        new_points: points at which to interpolate, in the frame and unit of the old ones.
        k: number of old points in a mean; all of them if there are fewer.

    Raises:
        UserError: there are no old points, a point is not finite, a column has another length, or `k` is below 1.

    Examples:
        >>> columns = {"red": np.array([0, 200], np.uint8), "label": np.array([7, 8])}
        >>> old, new = np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.25, 0, 0]])
        >>> {name: column.tolist() for name, column in carry(columns, old, new).items()}
        {'red': [0], 'label': [7]}
    """
    if k < 1:
        raise UserError(f"columns are interpolated from the k nearest points: k is {k}, it must be 1 or more")
    if not len(old_points):
        raise UserError("columns can't be interpolated: the cloud that they belong to has no points")
    for which, points in (("old", old_points), ("new", new_points)):
        if not np.isfinite(points).all():
            raise UserError(f"columns can't be interpolated: some of the {which} points are not finite: remove them")
    for name, column in columns.items():
        if len(column) != len(old_points):
            raise UserError(f"column '{name}' has {len(column)} rows for {len(old_points)} points")
    carried = {name: np.zeros((len(new_points), *column.shape[1:]), column.dtype) for name, column in columns.items()}
    if not columns:
        return carried
    colours = set(colour_names(columns))
    # Integers cannot hold normals of length 1.
    groups = [group for group in normal_groups(columns) if all(columns[name].dtype.kind == "f" for name in group)]
    in_groups = {name for group in groups for name in group}
    power = exponent([old_points, new_points])
    tree = KDTree(scaled(np.asarray(old_points, np.float64), -power))
    for start in range(0, len(new_points), CHUNK):
        rows = slice(start, start + CHUNK)
        scaled_points = scaled(np.asarray(new_points[rows], np.float64), -power)
        neighbours, weight = _weighted_neighbours(tree, scaled_points, min(k, len(old_points)))
        for name, column in columns.items():
            if name not in in_groups:
                averaged = column.dtype.kind == "f" or (name in colours and column.dtype.kind in "iu")
                nearest = neighbours[:, 0]
                carried[name][rows] = _mean(column, neighbours, weight) if averaged else column[nearest]
        for group in groups:
            normals = np.column_stack([columns[name] for name in group])
            for name, part in zip(group, _directions(normals, neighbours, weight, len(group)), strict=True):
                carried[name][rows] = part
    return carried


def _weighted_neighbours(
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


def _mean(column: np.ndarray, neighbours: Int[np.ndarray, "m k"], weight: Float64[np.ndarray, "m k"]) -> np.ndarray:
    """Compute weighted means of a column over neighbours, in the column's type."""
    nearest = column[neighbours[:, 0]]
    shares = (weight / weight.sum(axis=1, keepdims=True)).reshape(weight.shape + (1,) * (column.ndim - 1))
    with np.errstate(invalid="ignore", over="ignore"):
        values = column[neighbours].astype(np.float64)
        # Computed as a difference to the nearest value, so that constant columns stay exactly constant.
        mean = values[:, 0] + (shares * (values - values[:, :1])).sum(axis=1)
        if column.dtype.kind in "iu":
            kind = np.iinfo(column.dtype)
            mean = np.rint(mean).clip(kind.min, kind.max)
        copied = _only_nearest(weight).reshape(-1, *(1 for _ in column.shape[1:])) | ~np.isfinite(mean)
        result: np.ndarray = np.where(copied, nearest, mean.astype(column.dtype))
    return result


def _only_nearest(weight: Float64[np.ndarray, "m k"]) -> Bool[np.ndarray, " m"]:
    """Return where all weights but that of the nearest point are 0."""
    only: Bool[np.ndarray, " m"] = (weight[:, 1:] == 0).all(axis=1)
    return only


def _directions(
    normals: Float[np.ndarray, "n 3"],
    neighbours: Int[np.ndarray, "m k"],
    weight: Float64[np.ndarray, "m k"],
    parts: int,
) -> list[np.ndarray]:
    """Compute weighted mean normals of length 1, as three columns of one number or one column of three."""
    values = normals[neighbours].astype(np.float64)
    nearest = normals[neighbours[:, 0]]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        total = (weight[..., None] * values).sum(axis=1)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        longest = (weight * np.linalg.norm(values, axis=2)).max(axis=1, keepdims=True)
        cancelled = ~(length > CANCELLED * longest)  # also zero or not finite
        mean = np.where(_only_nearest(weight)[:, None] | cancelled, nearest, total / length)
    return [mean] if parts == 1 else list(mean.T)
