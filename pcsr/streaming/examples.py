"""Rows of a cloud with the values that decide how the whole cloud is written."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from pcsr.clouds.cloud import Cloud

BEYOND = 0.05
"""New points may lie outside of the cloud's box by this part of its largest side."""
WITHIN = 1 / 3
"""Place in the box of a new point, whose coordinates have all digits."""


def deciding(cloud: Cloud) -> Int[np.ndarray, " m"]:
    """Return the rows with the smallest and largest value of each column and coordinate, and one of each other kind.

    The other kinds are numbers that are not whole, that single precision does not represent, and that are not finite.
    """
    rows: set[int] = set()
    for column in [*cloud.points.T, *cloud.columns.values()]:
        for values in column.T if column.ndim == 2 else [column]:
            rows.update(_deciding(values))
    return np.array(sorted(rows), np.int64)


def _deciding(values: np.ndarray) -> list[int]:
    if values.dtype.kind != "f":
        return [int(values.argmin()), int(values.argmax())] if len(values) else []
    finite = np.isfinite(values)
    with np.errstate(invalid="ignore", over="ignore"):
        masks: list[Bool[np.ndarray, " n"]] = [
            ~finite,
            finite & (values != np.rint(values)),
            finite & (values.astype(np.float32) != values),
        ]
    found = [int(mask.argmax()) for mask in masks if mask.any()]
    if finite.any():
        found += [int(np.where(finite, values, np.inf).argmin()), int(np.where(finite, values, -np.inf).argmax())]
    return found


def joined(clouds: Sequence[Cloud]) -> Cloud:
    """Return one cloud of several with the same columns."""
    columns = {name: np.concatenate([cloud.columns[name] for cloud in clouds]) for name in clouds[0].columns}
    return Cloud(np.concatenate([cloud.points for cloud in clouds]), columns, clouds[-1].about)


def with_new_points(examples: Cloud) -> Cloud:
    """Add rows such as the new points will be: two corners of a slightly larger box, and a point within.

    Args:
        examples: rows with the smallest and largest coordinates, and at least one that is finite.
    """
    finite = np.flatnonzero(np.isfinite(examples.points).all(axis=1))
    lower, upper = examples.points[finite].min(axis=0), examples.points[finite].max(axis=0)
    beyond = BEYOND * (upper - lower).max()
    corners = np.stack([lower - beyond, upper + beyond, lower + (upper - lower) * WITHIN])
    if examples.is_single:
        corners = corners.astype(np.float32).astype(np.float64)
    first = examples.chosen(np.repeat(finite[:1], len(corners)))
    return joined([examples, Cloud(corners, first.columns, examples.about)])
