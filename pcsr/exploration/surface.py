"""Known surface of an object: the cloud and the touched points, with their spacing and the variation of normals."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from pcsr.errors import UserError

FINEST = 1.0
"""Clouds of a smaller median spacing, in mm, are thinned to cells of this side: finer points
hardly change a contact."""
SHARE = 0.6
"""Side of the cells to which touched points are thinned, in median spacings of the cloud."""
SPACED = 4
"""Neighbours whose mean distance is the spacing of a point."""
AROUND = 8
"""Neighbours whose normals are compared, and through which a plane is fitted."""
THIN = 1e-3
"""A cloud whose second principal extent is smaller than this share of the first is a line."""
FEWEST = 16
"""Smallest number of points of a cloud."""


@dataclass(frozen=True)
class KnownSurface:
    """Known points in mm, with local properties of the surface."""

    tree: KDTree
    """All known points."""
    points: Float[np.ndarray, "n 3"]
    """Known points, thinned: first those of the cloud, then the touched ones."""
    seen: int
    """Number of points of the cloud among them."""
    thinned: KDTree
    """The thinned points."""
    spacing: Float[np.ndarray, " n"]
    """Mean distance of each thinned point to its neighbours."""
    normals: Float[np.ndarray, "n 3"]
    """Unit normals of the thinned points, of either sign."""
    variation: Float[np.ndarray, " n"]
    """Mean squared sine of the angle between the normal of each thinned point and those around it: 0 on a plane."""
    area: float
    """Area of the surface that the cloud samples, in mm²."""

    @classmethod
    def of(cls, cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]) -> "KnownSurface":
        """Describe the surface known from a cloud and from touched points, both in mm.

        Raises:
            UserError: the cloud has too few distinct points, or they lie on a line.
        """
        seen = np.unique(cloud, axis=0)
        if len(seen) >= FEWEST and _median_spacing(seen) < FINEST:
            thinned = thin(seen, FINEST)
            seen = thinned if len(thinned) >= FEWEST else seen
        if len(seen) < FEWEST:
            raise UserError(f"the cloud has {len(seen)} distinct points: at least {FEWEST} are needed")
        extents = np.linalg.svd(seen - seen.mean(0), compute_uv=False)
        if extents[1] < THIN * extents[0]:
            raise UserError("the points of the cloud lie on a line, which has no normals: give a surface")
        distances, _ = KDTree(seen).query(seen, k=SPACED + 1)
        # The disc to the k-th neighbour holds k points, half of the last on average.
        area = float(np.pi * (distances[:, -1] ** 2).sum() / SPACED)
        cell = max(FINEST, SHARE * float(np.median(distances[:, 1:].mean(1))))
        points = np.concatenate([seen, thin(touched, cell)])
        tree = KDTree(points)
        distances, rows = tree.query(points, k=AROUND + 1)
        normals = plane_normals(points[rows])
        cosines = np.einsum("nj,nkj->nk", normals, normals[rows[:, 1:]])
        return cls(
            tree=KDTree(np.concatenate([cloud, touched])),
            points=points,
            seen=len(seen),
            thinned=tree,
            spacing=distances[:, 1 : SPACED + 1].mean(1),
            normals=normals,
            variation=1 - (cosines**2).mean(1),
            area=area,
        )


def _median_spacing(points: Float[np.ndarray, "n 3"]) -> float:
    some = points[:: max(1, len(points) // 2048)]
    return float(np.median(KDTree(points).query(some, k=SPACED + 1)[0][:, 1:].mean(1)))


def thin(points: Float[np.ndarray, "n 3"], cell: float) -> Float[np.ndarray, "k 3"]:
    """Return the first point in each cell of a grid, in the order of the points.

    Args:
        points: points, (n 3).
        cell: side of a cell, in the unit of the points.

    Examples:
        >>> thin(np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [1.5, 0.0, 0.0]]), cell=1.0)
        array([[0.1, 0. , 0. ],
               [1.5, 0. , 0. ]])
    """
    if len(points) == 0:
        return np.zeros((0, 3))
    cells: Int[np.ndarray, "n 3"] = np.floor((points - points.min(0)) / cell).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    kept: Float[np.ndarray, "k 3"] = points[np.sort(first)]
    return kept


def plane_normals(around: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, "n 3"]:
    """Return the unit normal of the plane through each set of points, of either sign."""
    centred = around - around.mean(1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))
    normals: Float[np.ndarray, "n 3"] = axes[:, :, 0]
    return normals
