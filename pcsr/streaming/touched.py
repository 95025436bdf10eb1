"""Touched points in regions where a sorted cloud has no points."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int
from scipy.spatial import cKDTree

from pcsr.errors import PcsrWarning
from pcsr.geometry.magnitude import scaled
from pcsr.streaming.filling import SortedCloud, touches_near
from pcsr.streaming.sorting import Tile
from pcsr.streaming.tiles import box_distance
from pcsr.tensors import CloudArray
from pcsr.upsample.gaps import REACH, spacing
from pcsr.upsample.unseen import evenly


@dataclass(frozen=True, eq=False)
class Unseen:
    """Touched points that are added to the tiles."""

    points: CloudArray
    """The points, divided by a power of two as the tiles are."""
    tiles: Int[np.ndarray, " m"]
    """Index of the tile of each."""
    distance: float
    """Largest of their distances from the cloud, in its unit."""

    @classmethod
    def of(cls, cloud: SortedCloud, touches: list[CloudArray], patch: int, power: int) -> "Unseen":
        """Select touched points in regions without cloud points, as `unseen` does for a cloud in memory.

        They are subsampled to the median density of the tiles that are touched.

        Args:
            cloud: the cloud.
            touches: touched points, one array for each touch, divided by 2^power.
            patch: number of points of a patch.
            power: exponent by which the touches are scaled.
        """
        none = cls(np.zeros((0, 3)), np.zeros(0, np.int64), 0.0)
        if not touches:
            return none
        touched = np.unique(np.concatenate(touches), axis=0)
        nearest = np.full(len(touched), np.inf)
        owner, gap = np.zeros(len(touched), np.int64), np.zeros(len(touched))
        medians = np.zeros(len(cloud.plan.tiles))
        for index, tile in enumerate(cloud.plan.tiles):
            lower, upper = (scaled(np.array(corner), -power) for corner in (tile.lower, tile.upper))
            possible = np.flatnonzero(box_distance(touched, lower, upper) < nearest)
            if not len(possible):
                continue
            own = cloud.own(tile)
            margin, _ = cloud.margin(tile, own, patch)
            points = scaled(np.concatenate([own.points, margin.points]), -power)
            each = spacing(points)[: len(own)]
            medians[index] = np.median(each)
            distance, row = cKDTree(points[: len(own)]).query(touched[possible])
            closer = distance < nearest[possible]
            rows = possible[closer]
            nearest[rows], owner[rows], gap[rows] = distance[closer], index, each[row[closer]]
        away = nearest > REACH * gap
        if not away.any():
            return none
        chosen = evenly(touched[away], float(np.median(medians[np.unique(owner)])))
        place = cKDTree(touched).query(chosen)[1]
        return cls(chosen, owner[place], float(np.ldexp(nearest[place].max(), power)))

    def first(self, count: int) -> "Unseen":
        """Return the first points, at most `count`, which are spread evenly."""
        return replace(self, points=self.points[:count], tiles=self.tiles[:count])

    def near(self, tile: Tile, width: float, power: int, *, except_for: int) -> CloudArray:
        """Return the points within the margin of a tile, of other tiles than that with the index `except_for`."""
        found = touches_near([self.points[self.tiles != except_for]], tile, width, power)
        return found[0] if found else np.zeros((0, 3))

    def warn(self, new: int) -> None:
        """Warn of the points, if there are any: the region may be unseen, or the pose of the sensor wrong.

        Args:
            new: number of new points.
        """
        if not len(self.points):
            return
        fewer = len(self.points) > new
        more = f"; only {new} of them fit into the count, so ask for more points" if fewer else ""
        warnings.warn(
            f"{len(self.points)} touched points lie up to {self.distance:.4g} from the cloud and are added to it as "
            f"unseen surface: if the cloud covers that region, these touches are misplaced{more}",
            PcsrWarning,
            stacklevel=5,
        )
