"""Columns of a cloud carried over to other points of the same surface: colours, normals, labels."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial import KDTree

from pcsr.clouds.columns import colour_names, normal_groups
from pcsr.errors import UserError
from pcsr.geometry.magnitude import exponent, scaled

CHUNK = 1 << 18
"""New points that are dealt with at once: some 50 MB."""
CANCELLED = 1e-9
"""Normals that add up to less than this share of their length point nowhere."""


def carry(
    columns: Mapping[str, np.ndarray],
    old_points: Float[np.ndarray, "n 3"],
    new_points: Float[np.ndarray, "m 3"],
    k: int = 3,
) -> dict[str, np.ndarray]:
    """The columns of new points, from the old points nearest to them. Names, order and types stay.

    Floats and colours are means of the `k` nearest, weighted by the inverse of the distance; colours are rounded
    back into their type. Normals are such means, of length 1; where they cancel out, the nearest's. Other
    integers and truth values, such as labels, are the nearest's, and so is what has no finite mean. A new point
    that coincides with an old one has exactly what that has.

    Args:
        columns: name to (n,) or (n, c).
        old_points: the points that the columns are of, in the unit of the new ones.
        new_points: where the columns are wanted.
        k: how many old points each mean is over; all of them where there are fewer.

    Raises:
        UserError: no old points, points that are not finite, a column of another length, or `k` below 1.
    """
    if k < 1:
        raise UserError(f"columns are carried over from the k nearest points: k is {k}, at least 1 is needed")
    if not len(old_points):
        raise UserError("columns can't be carried over from a cloud that holds no points")
    for which, points in (("old", old_points), ("new", new_points)):
        if not np.isfinite(points).all():
            raise UserError(f"columns can't be carried over: some of the {which} points are not finite: remove them")
    for name, column in columns.items():
        if len(column) != len(old_points):
            raise UserError(f"column '{name}' has {len(column)} rows for {len(old_points)} points")
    carried = {name: np.zeros((len(new_points), *column.shape[1:]), column.dtype) for name, column in columns.items()}
    if not columns:
        return carried
    colours = set(colour_names(columns))
    # Normals in integers would have no length 1.
    groups = [group for group in normal_groups(columns) if all(columns[name].dtype.kind == "f" for name in group)]
    of_group = {name for group in groups for name in group}
    power = exponent([old_points, new_points])
    tree = KDTree(scaled(np.asarray(old_points, np.float64), -power))
    for start in range(0, len(new_points), CHUNK):
        rows = slice(start, start + CHUNK)
        nearby, weight = _nearby(
            tree, scaled(np.asarray(new_points[rows], np.float64), -power), min(k, len(old_points))
        )
        for name, column in columns.items():
            if name not in of_group:
                mixed = column.dtype.kind == "f" or (name in colours and column.dtype.kind in "iu")
                carried[name][rows] = _mean(column, nearby, weight) if mixed else column[nearby[:, 0]]
        for group in groups:
            normals = np.column_stack([columns[name] for name in group])
            for name, part in zip(group, _directions(normals, nearby, weight, len(group)), strict=True):
                carried[name][rows] = part
    return carried


def _nearby(
    tree: KDTree, points: Float64[np.ndarray, "m 3"], k: int
) -> tuple[Int[np.ndarray, "m k"], Float64[np.ndarray, "m k"]]:
    """The nearest old points, the nearest first, and the weight of each; the first's is 1."""
    distance, nearby = tree.query(points, k=range(1, k + 1), workers=-1)
    first = distance[:, :1]
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = first / distance
    # On top of an old point that one alone counts.
    weight[:] = np.where(first > 0, weight, 0.0)
    weight[:, 0] = 1.0
    return nearby, weight


def _mean(column: np.ndarray, nearby: Int[np.ndarray, "m k"], weight: Float64[np.ndarray, "m k"]) -> np.ndarray:
    """Weighted means of what the near points have, in the column's type."""
    nearest = column[nearby[:, 0]]
    shares = (weight / weight.sum(axis=1, keepdims=True)).reshape(weight.shape + (1,) * (column.ndim - 1))
    with np.errstate(invalid="ignore", over="ignore"):
        values = column[nearby].astype(np.float64)
        # As a step from the nearest, so that what is the same everywhere stays exactly the same.
        mean = values[:, 0] + (shares * (values - values[:, :1])).sum(axis=1)
        if column.dtype.kind in "iu":
            kind = np.iinfo(column.dtype)
            mean = np.rint(mean).clip(kind.min, kind.max)
        same = _alone(weight).reshape(-1, *(1 for _ in column.shape[1:])) | ~np.isfinite(mean)
        found: np.ndarray = np.where(same, nearest, mean.astype(column.dtype))
    return found


def _alone(weight: Float64[np.ndarray, "m k"]) -> Bool[np.ndarray, " m"]:
    """Where the nearest counts alone."""
    alone: Bool[np.ndarray, " m"] = (weight[:, 1:] == 0).all(axis=1)
    return alone


def _directions(
    normals: Float[np.ndarray, "n 3"],
    nearby: Int[np.ndarray, "m k"],
    weight: Float64[np.ndarray, "m k"],
    parts: int,
) -> list[np.ndarray]:
    """Mean normals of length 1, as three columns of one number or as one of three."""
    values = normals[nearby].astype(np.float64)
    nearest = normals[nearby[:, 0]]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        total = (weight[..., None] * values).sum(axis=1)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        longest = (weight * np.linalg.norm(values, axis=2)).max(axis=1, keepdims=True)
        pointless = ~(length > CANCELLED * longest)  # zero, cancelled out or not finite
        mean = np.where(_alone(weight)[:, None] | pointless, nearest, total / length)
    return [mean] if parts == 1 else list(mean.T)
