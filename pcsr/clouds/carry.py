"""Interpolation of a cloud's columns (colours, normals, labels) at new points of the same surface."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.clouds.averages import mean, mean_direction, weighted_neighbours
from pcsr.clouds.column_kinds import ColumnKinds, column_kinds
from pcsr.errors import UserError
from pcsr.geometry.magnitude import exponent, scaled

CHUNK = 1 << 18
"""New points that are processed at once: about 50 MB."""


def carry(
    columns: Mapping[str, np.ndarray],
    old_points: Float[np.ndarray, "n 3"],
    new_points: Float[np.ndarray, "m 3"],
    k: int = 3,
    kinds: ColumnKinds | None = None,
) -> dict[str, np.ndarray]:
    """Interpolate the columns of a cloud at new points. Names, order and types of the columns are kept.

    `column_kinds` decides by names and values how a column is carried:

    - Colours and measured quantities: mean of the `k` nearest old points, weighted by the inverse distance. Whole
      numbers stay whole.
    - Normals, other directions and quaternions: the same mean, with signs as of the nearest point's, scaled to
      length 1.
    - Labels, identifiers, times, flags and angles, and values without a finite mean: value of the nearest old point.

    A new point that coincides with an old one gets exactly its values.

    Args:
        columns: arrays (n,) or (n, c) by name.
        old_points: points of the columns.
        new_points: points at which to interpolate, in the frame and unit of the old ones.
        k: number of old points in a mean; all of them if there are fewer.
        kinds: how each column is carried, where `columns` is part of a larger cloud; by default `column_kinds`.

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
    kinds = kinds or column_kinds(columns)
    power = exponent([old_points, new_points])
    tree = KDTree(scaled(np.asarray(old_points, np.float64), -power))
    for start in range(0, len(new_points), CHUNK):
        rows = slice(start, start + CHUNK)
        scaled_points = scaled(np.asarray(new_points[rows], np.float64), -power)
        neighbours, weight = weighted_neighbours(tree, scaled_points, min(k, len(old_points)))
        for name in kinds.nearest:
            carried[name][rows] = columns[name][neighbours[:, 0]]
        for name in kinds.averaged:
            carried[name][rows] = mean(columns[name], neighbours, weight, whole=name in kinds.rounded)
        for group in kinds.directions:
            directions = mean_direction(np.column_stack([columns[name] for name in group]), neighbours, weight)
            for name, part in zip(group, [directions] if len(group) == 1 else directions.T, strict=True):
                carried[name][rows] = part
    return carried
