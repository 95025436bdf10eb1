"""A cloud of any size as patches of one size: each point in the core of one patch, and in the margin of others.

What becomes of the space nearest to a point is the business of the patch whose core the point is in. So nothing is
made twice, nothing is left out, and each patch may be worked on without knowing of the others.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.geometry.frames import principal_axes


@dataclass(frozen=True)
class Patch:
    """Rows of a cloud."""

    rows: Int[np.ndarray, " n"]
    """The core's first, then the margin's, nearest first."""
    core: int
    """How many are the core's."""


def patches(points: Float[np.ndarray, "n 3"], size: int, core: int) -> Iterator[Patch]:
    """Patches of `size` points, or one of all points where there are no more.

    Args:
        points: the cloud, in any frame; finite.
        size: points of a patch.
        core: most points of a patch's core.
    """
    if len(points) <= size:
        yield Patch(np.arange(len(points)), len(points))
        return
    tree = cKDTree(points)
    for cell in cells(points, core):
        nearest = tree.query(points[cell].mean(0), k=size)[1]
        margin = nearest[~np.isin(nearest, cell)][: size - len(cell)]
        yield Patch(np.concatenate([cell, margin]), len(cell))


def in_patch(touches: Float[Tensor, "*b m 3"]) -> Bool[Tensor, "*b"]:
    """Which touches belong to a patch, whose own frame they are in: those whose middle lies in its unit sphere."""
    inside: Tensor = touches.mean(-2).norm(dim=-1) <= 1
    return inside


def cells(points: Float[np.ndarray, "n 3"], most: int) -> Iterator[Int[np.ndarray, " cell"]]:
    """A cloud cut into cells of about equal size, of `most` points at most; neighbouring cells follow each other.

    Each cut is across the direction in which the points spread farthest, so that cells are round, and the same
    however the cloud is turned.
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
