"""Upsampling of one tile of a sorted cloud, within its neighbourhood."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from pcsr.clouds.cloud import Cloud
from pcsr.geometry.magnitude import scaled
from pcsr.streaming.sorting import Plan, Tile
from pcsr.streaming.stored import unpacked
from pcsr.streaming.tiles import box_distance, boxes_apart
from pcsr.streaming.work_folder import WorkFolder
from pcsr.tensors import CloudArray

EACH = 64
"""One of so many points of a tile is asked for the size of the patch around it."""
NEARLY_ALL = 0.98
"""Share of them whose patches fit into the margin; those of the rest are around stray points."""
WIDER = 1.25
"""The margin is this many times as wide as those patches."""


class SortedCloud:
    """Cloud that was sorted into tiles.

    Args:
        work: folder with the tiles.
        plan: the plan that the folder holds.
        names: names of the columns.
        about: `about` of the cloud in the file.
    """

    def __init__(self, work: WorkFolder, plan: Plan, names: Sequence[str], about: dict[str, Any]) -> None:
        self.work, self.plan, self.names, self.about = work, plan, names, about
        self.lowers = np.array([tile.lower for tile in plan.tiles])
        self.uppers = np.array([tile.upper for tile in plan.tiles])

    def own(self, tile: Tile) -> Cloud:
        """Return the points of a tile."""
        return self._cloud(self.work.load(tile.name))

    def margin(self, tile: Tile, own: Cloud, patch: int) -> tuple[Cloud, float]:
        """Return the points around a tile, and the width of the margin.

        The patches of nearly all points fit into the margin. It holds no more points than the tile, or four patches:
        where there would be more, the nearest to the tile's box.

        Args:
            tile: the tile.
            own: its points.
            patch: number of points of a patch.
        """
        lower, upper = np.array(tile.lower), np.array(tile.upper)
        width = _patch_radius(own.points, patch)
        most = max(len(own), 4 * patch)
        tables, away = [self.work.load(tile.name)[:0]], [np.zeros(0)]
        for number in np.flatnonzero(boxes_apart(lower, upper, self.lowers, self.uppers) <= width):
            other = self.plan.tiles[number]
            if other.number == tile.number:
                continue
            table = self.work.load(other.name)
            distance = box_distance(table["points"], lower, upper)
            near = distance <= width
            tables.append(table[near])
            away.append(distance[near])
            if sum(map(len, tables)) > 2 * most:
                tables, away = _nearest(tables, away, most)
        tables, away = _nearest(tables, away, most)
        return self._cloud(tables[0]), width

    def _cloud(self, table: np.ndarray) -> Cloud:
        return unpacked(table, self.names, self.about)


def _nearest(
    tables: list[np.ndarray], away: list[Float64[np.ndarray, " _"]], most: int
) -> tuple[list[np.ndarray], list[Float64[np.ndarray, " _"]]]:
    """Return at most `most` rows, those nearest to the tile, in the order of the file."""
    table, distance = np.concatenate(tables), np.concatenate(away)
    kept = np.lexsort((table["row"], distance))[:most]
    kept = kept[np.argsort(table["row"][kept])]
    return [table[kept]], [distance[kept]]


def _patch_radius(points: CloudArray, patch: int) -> float:
    """Return the radius of the patches around nearly all points; infinity if one patch has more points."""
    if len(points) <= patch:
        return float("inf")
    distance = cKDTree(points).query(points[::EACH], k=[patch])[0][:, 0]
    return WIDER * float(np.quantile(distance, NEARLY_ALL))


def touches_near(touches: Sequence[CloudArray], tile: Tile, width: float, power: int) -> list[CloudArray]:
    """Return the touched points within the margin of a tile, for each touch that has any.

    Args:
        touches: touched points, divided by 2^power.
        tile: the tile.
        width: width of the margin.
        power: exponent by which the touches are scaled.
    """
    lower, upper = (scaled(np.array(corner), -power) for corner in (tile.lower, tile.upper))
    width = float(np.ldexp(width, -power))
    inside = [touch[box_distance(touch, lower, upper) <= width] for touch in touches]
    return [touch for touch in inside if len(touch)]
