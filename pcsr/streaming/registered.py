"""Registration of touches to a sorted cloud, of which the points near the touches are enough."""

from collections.abc import Callable, Sequence

import numpy as np

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.registration import Registration
from pcsr.streaming.filling import SortedCloud
from pcsr.streaming.tiles import box_distance, boxes_apart
from pcsr.tensors import CloudArray
from pcsr.touches import GivenTouches

LEAST_MARGIN = 10.0
"""Smallest width of the margin around the box of a touch, in millimetres."""
DEVIATIONS = 4.0
"""The margin is at least this many standard deviations of the position error wide."""
MOST = 1 << 20
"""Most points of the cloud that touches are registered to; of more near the touches, a random part is used."""


def registered(
    touches: GivenTouches, cloud: SortedCloud, report: Callable[[Registration], None] | None
) -> GivenTouches:
    """Return the touches as they are registered to the points near them, without refused ones.

    Args:
        touches: the touches.
        cloud: the cloud.
        report: called with the registration; if it is None, a warning names the refused touches.
    """
    records = touches.to_register
    if not records:
        return touches
    registration = touches.registration(points_near(cloud, records, touches.pose_error or PoseError()))
    if registration is not None and report is not None:
        report(registration)
    return touches.moved(registration, warn=report is None)


def points_near(
    cloud: SortedCloud, touches: Sequence[Touch], pose_error: PoseError, most: int | None = None
) -> CloudArray:
    """Return the points of a cloud in the boxes of touches with a margin, in the order of the file.

    If there is none, those of the tile that is nearest to a touch are returned.

    Args:
        cloud: the cloud.
        touches: touches with points, in the cloud's frame and unit.
        pose_error: error of their poses.
        most: largest number of points, drawn at random; `MOST` by default. The result is the same in each call.
    """
    most = MOST if most is None else most
    lowers = np.array([touch.points.min(axis=0) for touch in touches])
    uppers = np.array([touch.points.max(axis=0) for touch in touches])
    turned = np.minimum(DEVIATIONS * np.radians(pose_error.rotation), 1) * np.linalg.norm(uppers - lowers, axis=1)
    margin = max(LEAST_MARGIN, DEVIATIONS * pose_error.position) / np.array([touch.unit for touch in touches]) + turned
    found: list[np.ndarray] = []
    priorities: list[np.ndarray] = []
    nearest, distance = 0, np.inf
    for index, tile in enumerate(cloud.plan.tiles):
        apart = boxes_apart(np.array(tile.lower), np.array(tile.upper), lowers, uppers)
        if apart.min() < distance:
            nearest, distance = index, float(apart.min())
        close = np.flatnonzero(apart <= margin)
        if not len(close):
            continue
        table = cloud.work.load(tile.name)
        near = np.zeros(len(table), bool)
        for one in close:
            near[~near] = box_distance(table["points"][~near], lowers[one], uppers[one]) <= margin[one]
        found.append(table[["row", "points"]][near])
        priorities.append(np.random.default_rng(tile.number).random(len(table))[near])
        if sum(map(len, found)) > most:
            kept = np.argsort(np.concatenate(priorities), kind="stable")[:most]
            found, priorities = [np.concatenate(found)[kept]], [np.concatenate(priorities)[kept]]
    if not any(map(len, found)):
        return cloud.own(cloud.plan.tiles[nearest]).points
    table = np.concatenate(found)
    return np.ascontiguousarray(table["points"][np.argsort(table["row"])])
