"""Registration of the touches of a recording to a cloud."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.registration.acceptance import Judgement, judge
from pcsr.registration.checks import checked
from pcsr.registration.consensus import arm_of
from pcsr.registration.fit import Posterior, Prior, fit
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import carried, isotropic, matrix
from pcsr.registration.neighbourhood import Neighbourhood, distinct
from pcsr.registration.overlaps import Overlaps
from pcsr.registration.point_errors import point_errors
from pcsr.registration.records import RegisteredTouch, Registration
from pcsr.registration.sides import shows_all_sides

REACH = 3.0
"""Distance from a touch up to which the cloud is looked at, in deviations of the position."""
BESIDE = 2.0
"""The same for an exact arm, in millimetres."""
FLOOR = 0.02
"""Smallest deviation of the cloud from a touched surface, in millimetres."""
FLOOR_SHARE = 0.01
"""The same, in spacings of the cloud."""
FEWEST = 4
"""Fewest points of the cloud on the touched surface by which the arm's error is estimated."""
LEAST_POSITION, LEAST_ROTATION = 0.01, 0.01
"""Smallest deviations of a pose that is not exact, in millimetres and degrees."""


def register(touches: Sequence[Touch], cloud: Any, *, pose_error: PoseError | None = None) -> Registration:
    """Register touches to a cloud.

    Each touch is a dense piece of the surface. It is moved onto the points of the cloud around it, as far as the error
    of the arm makes that likely, along the directions that they constrain. How large the error is, and what of it all
    touches share, is estimated from all touches. Of each touch those points are kept whose expected error is smaller
    than the cloud's.

    Args:
        touches: touches of one recording, in the frame and unit of the cloud.
        cloud: points that a camera or scanner saw, (n 3), finite: a numpy array, a torch tensor, a trimesh or an Open3D
            cloud.
        pose_error: error of the poses, as far as it is known; 1 mm and 2 degrees by default.

    Raises:
        UserError: the cloud or a touch is empty, not finite or of a size that only a wrong unit explains, or the
            touches have different units.

    Examples:
        >>> def waves(step, half):
        ...     x, y = np.mgrid[-half:half:step, -half:half:step].reshape(2, -1)
        ...     return np.column_stack([x, y, np.sin(0.6 * x) + np.cos(0.4 * y)])
        >>> cloud, points = waves(1.0, 12.0), waves(0.4, 5.0)
        >>> reported = pcsr.Touch.single(points + [0, 0, 0.7], np.eye(4), unit=1.0, sensor="digit")
        >>> registered = pcsr.register([reported], cloud).touches[0]
        >>> registered.verdict, bool(abs(registered.touch.points - points).max() < 0.1)
        ('moved', True)
    """
    touches, cloud, error = checked(touches, cloud, pose_error)
    if error.exact or not touches:
        return _unmoved(touches)
    cloud = distinct(cloud)
    centre = cloud.mean(0)
    margin = REACH * error.position + BESIDE
    stated = isotropic(max(error.position, LEAST_POSITION), np.radians(max(error.rotation, LEAST_ROTATION)))
    tree = cKDTree(cloud, balanced_tree=False)
    around = [Neighbourhood.of(touch, tree, centre, margin) for touch in touches]
    likelihoods = [_likelihood(one, margin) for one in around]
    floors = [max(FLOOR, one.noise, FLOOR_SHARE * one.spacing) for one in around]
    first = [fit(one, Prior(np.zeros(6), stated), floor) for one, floor in zip(likelihoods, floors, strict=True)]
    deviation = _pooled(first)
    frames = [carried(one.axes, one.origin) for one in around]
    used = [number for number, found in enumerate(first) if found.freedom + 3 >= FEWEST]
    arm = arm_of(
        [first[number] for number in used],
        [likelihoods[number] for number in used],
        [frames[number] for number in used],
        stated,
        [floors[number] for number in used],
        deviation,
    )
    evidence = {number: index for index, number in enumerate(used)}
    results: dict[int, RegisteredTouch] = {}
    others = Overlaps()
    all_sides = shows_all_sides(cloud)
    for number in sorted(range(len(touches)), key=lambda number: -first[number].freedom):
        touch, one = touches[number], around[number]
        likelihood = likelihoods[number] if number in evidence else others.around(one, likelihoods[number], margin)
        before = arm.prior(frames[number], evidence.get(number))
        after = fit(likelihood, before, floors[number], max(deviation, floors[number]))
        errors = np.hypot(point_errors(likelihood, after, one.points), _own_errors(touch) * touch.unit)
        judgement = judge(one, likelihood, before, after, errors, all_sides=all_sides)
        results[number] = _result(touch, one, after, errors, judgement, centre)
        registered = results[number].touch.points
        others.add((registered - centre) * touch.unit, results[number].errors * touch.unit)
    offset = arm.offset()
    shared = _in_cloud(matrix(offset.mean), np.eye(3), np.zeros(3), centre, touches[0].unit)
    covariance = _scaled(offset.covariance, touches[0].unit)
    in_order = [results[number] for number in range(len(touches))]
    return Registration(in_order, shared, covariance, arm.shared * error.position, arm.private * error.position)


def _unmoved(touches: Sequence[Touch]) -> Registration:
    """Return the registration of touches with exact poses."""
    kept = [
        RegisteredTouch(touch, np.eye(4), np.zeros((6, 6)), _own_errors(touch), 0, "kept", "its pose is exact")
        for touch in touches
    ]
    return Registration(kept, np.eye(4), np.zeros((6, 6)), 0.0, 0.0)


def _own_errors(touch: Touch) -> Float[np.ndarray, " m"]:
    """Return the expected error of each point by the sensor; 0 if it is unknown."""
    return np.zeros(len(touch.points)) if touch.errors is None else np.array(touch.errors, np.float64)


def _likelihood(one: Neighbourhood, margin: float) -> Likelihood:
    """Return the likelihood of a touch's motion, without points too deep behind the contact to count for any."""
    near = np.zeros(len(one.near), bool)
    for surface in one.surfaces:
        distance, outside = surface.find(one.near)
        near |= (distance > -margin) & np.isfinite(outside)
    return Likelihood(one.surfaces, one.near[near], one.near_spacing)


def _pooled(fits: Sequence[Posterior]) -> float:
    """Return the deviation of the cloud from all touched surfaces."""
    total = sum(one.freedom for one in fits)
    return float(np.sqrt(sum(one.freedom * one.deviation**2 for one in fits) / total)) if total else 0.0


def _result(
    touch: Touch,
    one: Neighbourhood,
    after: Posterior,
    errors: Float[np.ndarray, " m"],
    judgement: Judgement,
    centre: Float[np.ndarray, "3"],
) -> RegisteredTouch:
    """Express the motion of a touch in the frame and unit of the cloud."""
    still = judgement.verdict == "kept"
    local = np.eye(4) if still else matrix(after.motion)
    motion = np.eye(4) if still else _in_cloud(local, one.axes, one.origin, centre, touch.unit)
    points = touch.points if still else touch.points @ motion[:3, :3].T + motion[:3, 3]
    turned = np.kron(np.eye(2), one.axes)
    poses = motion @ touch.poses if len(touch.poses) else touch.poses
    new = replace(touch, points=points, poses=poses).subset(judgement.kept)
    return RegisteredTouch(
        touch=new,
        motion=motion,
        covariance=_scaled(turned @ after.covariance @ turned.T, touch.unit),
        errors=errors[judgement.kept] / touch.unit,
        support=judgement.support,
        verdict=judgement.verdict,
        reason=judgement.reason,
    )


def _in_cloud(
    motion: Float[np.ndarray, "4 4"],
    axes: Float[np.ndarray, "3 3"],
    origin: Float[np.ndarray, "3"],
    centre: Float[np.ndarray, "3"],
    unit: float,
) -> Float[np.ndarray, "4 4"]:
    """Express a motion of a frame, in millimetres, in the frame and unit of the cloud.

    Args:
        motion: in the frame with these axes.
        axes: as columns.
        origin: origin of that frame, from the centre and in millimetres.
        centre: centroid of the cloud.
        unit: unit of the cloud in millimetres.
    """
    turned = axes @ motion[:3, :3] @ axes.T
    about = centre + origin / unit
    whole = np.eye(4)
    whole[:3, :3] = turned
    whole[:3, 3] = about + axes @ motion[:3, 3] / unit - turned @ about
    return whole


def _scaled(covariance: Float[np.ndarray, "6 6"], unit: float) -> Float[np.ndarray, "6 6"]:
    """Return a covariance with translations in another unit than the millimetre."""
    scale = np.repeat([1.0, 1 / unit], 3)
    scaled: Float[np.ndarray, "6 6"] = covariance * np.outer(scale, scale)
    return scaled
