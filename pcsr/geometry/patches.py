"""Overlapping patches of a cloud. Each point is in the core of exactly one patch, and may be in margins of others.

Output nearest to a core point belongs to that patch. Patches can thus be processed independently, without gaps and
without duplicates.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.geometry.frames import principal_axes

AROUND = 2
"""The margin of a patch is chosen among so many times as many points around its core as the patch has."""


@dataclass(frozen=True)
class Patch:
    """Patch of a cloud: its core, and a margin around it."""

    rows: Int[np.ndarray, " n"]
    """Row numbers in the cloud: the core, then the margin in the order of distance."""
    core: int
    """Number of rows of the core."""


def patches(
    points: Float[np.ndarray, "n 3"], size: int, core: int, within: Int[np.ndarray, " m"] | None = None
) -> Iterator[Patch]:
    """Divide a cloud into patches of `size` points, or one patch if there are no more points.

    Args:
        points: finite points, in any frame.
        size: number of points of a patch.
        core: largest number of points in a core.
        within: rows that the cores consist of; all by default. Margins consist of any points.
    """
    rows = np.arange(len(points)) if within is None else within
    if len(points) <= size:
        margin = np.delete(np.arange(len(points)), rows)
        yield Patch(np.concatenate([rows, margin]), len(rows))
        return
    tree = cKDTree(points)
    for chosen in cells(points[rows], core):
        cell = rows[chosen]
        around = tree.query(points[cell].mean(0), k=min(AROUND * size, len(points)))[1]
        around = around[~np.isin(around, cell)]
        distance = cKDTree(points[cell]).query(points[around])[0]
        margin = around[np.lexsort((np.arange(len(around)), distance))[: size - len(cell)]]
        yield Patch(np.concatenate([cell, margin]), len(cell))


def in_patch(touches: Float[Tensor, "*b m 3"]) -> Bool[Tensor, "*b"]:
    """Return which touches belong to a patch: those whose centroid lies in its unit sphere.

    Args:
        touches: touches in the frame of the patch.
    """
    inside: Tensor = touches.mean(-2).norm(dim=-1) <= 1
    return inside


def cells(points: Float[np.ndarray, "n 3"], most: int) -> Iterator[Int[np.ndarray, " cell"]]:
    """Divide a cloud into cells of about equal size and at most `most` points. Consecutive cells are neighbours.

    The cloud is split recursively along its first principal axis. Cells are thus compact, and invariant to rotation.
    """
    waiting = [np.arange(len(points))]
    while waiting:
        rows = waiting.pop()
        count = -(-len(rows) // most)
        if count <= 1:
            yield rows
            continue
        here = points[rows]
        along = here @ principal_axes(here)[:, 0]
        split = len(rows) * (count // 2) // count
        order = np.argpartition(along, split)
        waiting += [rows[order[split:]], rows[order[:split]]]
