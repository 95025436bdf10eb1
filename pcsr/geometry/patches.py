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

DIGITS = 7
"""Decimals of coordinates in a patch's own frame: about what single precision holds."""


@dataclass(frozen=True)
class Patch:
    """Rows of a cloud."""

    rows: Int[np.ndarray, " n"]
    """The core's first, then the margin's, nearest first."""
    core: int
    """How many are the core's."""


@dataclass(frozen=True)
class OwnFrame:
    """A frame that a cloud brings along: turned, moved and scaled, the cloud looks the same in it."""

    centre: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    radius: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"]) -> "OwnFrame":
        """Centred, along the cloud's principal axes, its farthest point on the unit sphere."""
        centre = points.mean(0)
        radius = float(np.linalg.norm(points - centre, axis=1).max())
        return cls(centre, principal_axes(points), radius or 1.0)

    def into(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Into it, without the last digits: they depend on where the cloud was, and would decide ties."""
        local: Float[np.ndarray, "p 3"] = np.round((points - self.centre) @ self.axes / self.radius, DIGITS)
        return local

    def back(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Out of it."""
        outside: Float[np.ndarray, "p 3"] = points * self.radius @ self.axes.T + self.centre
        return outside


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


def principal_axes(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """A right-handed frame of the cloud's own, as columns: widest spread first, each to the side of the longer tail.

    It turns with the cloud, unless the cloud is symmetric.
    """
    centred = points - points.mean(0)
    scale = np.abs(centred).max() or 1.0
    centred = centred / scale
    axes: Float[np.ndarray, "3 3"] = np.linalg.eigh(centred.T @ centred)[1][:, ::-1].copy()
    tails = ((centred @ axes) ** 3).sum(0)
    axes[:, :2] *= np.where(tails[:2] < 0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes
