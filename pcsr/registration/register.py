"""Registration of the touches of a recording to a cloud."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.registration.arm import Arm, Evidence
from pcsr.registration.fit import Posterior, Prior, fit
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import carried, isotropic, matrix
from pcsr.registration.point_errors import point_errors
from pcsr.registration.records import RegisteredTouch, Registration
from pcsr.registration.situation import Situation

REACH = 3.0
"""Distance from a touch up to which the cloud is looked at, in deviations of the position."""
FLOOR = 0.02
"""Smallest deviation of the cloud from a touched surface, in millimetres."""
FLOOR_SHARE = 0.01
"""The same, in spacings of the cloud."""
TRUSTED = 0.12
"""Largest expected error of a touched point that is used, in spacings of the cloud."""
FEWEST = 4
"""Fewest points of the cloud on the touched surface by which the arm's error is estimated."""


def register(
    touches: Sequence[Touch], cloud: Float[np.ndarray, "n 3"], *, pose_error: PoseError | None = None
) -> Registration:
    """Register touches to a cloud.

    Args:
        touches: touches of one recording, in the frame and unit of the cloud.
        cloud: points that a camera or scanner saw, (n 3), finite.
        pose_error: error of the poses, as far as it is known; 1 mm and 2 degrees by default. Its size is estimated
            from the touches too.
    """
    error = PoseError() if pose_error is None else pose_error
    centre = cloud.mean(0)
    margin = REACH * error.position + 2.0
    prior = isotropic(max(error.position, 0.01), np.radians(max(error.rotation, 0.01)))
    around = [Situation.of(touch, cloud, centre, margin) for touch in touches]
    likelihoods = [_likelihood(one, margin) for one in around]
    floors = [max(FLOOR, one.noise, FLOOR_SHARE * one.spacing) for one in around]
    first = [fit(one, Prior(np.zeros(6), prior), floor) for one, floor in zip(likelihoods, floors, strict=True)]
    deviation = _pooled(first)
    frames = [carried(one.axes, one.origin) for one in around]
    used = [
        number
        for number, (found, one) in enumerate(zip(first, likelihoods, strict=True))
        if _support(one, found.motion, found.deviation) >= FEWEST
    ]
    evidence = [Evidence(first[number].information, first[number].vector, frames[number]) for number in used]
    arm = Arm.of(evidence, prior)
    results = []
    for number, (touch, one, likelihood) in enumerate(zip(touches, around, likelihoods, strict=True)):
        before = arm.prior(frames[number], used.index(number) if number in used else None)
        after = fit(likelihood, before, floors[number], max(deviation, floors[number]))
        errors = point_errors(likelihood, after, one.points)
        results.append(_result(touch, one, likelihood, after, errors, centre))
    offset = arm.offset()
    return Registration(
        results,
        matrix(offset.mean),
        offset.covariance,
        arm.shared * error.position,
        arm.private * error.position,
    )


def _likelihood(one: Situation, margin: float) -> Likelihood:
    """Return the likelihood of a touch's motion, without points too deep behind the contact to count for any."""
    depth = np.stack([surface.find(one.near).distance for surface in one.surfaces])
    beside = np.stack([surface.find(one.near).outside for surface in one.surfaces])
    near = ((depth > -margin) & np.isfinite(beside)).any(0)
    return Likelihood(one.surfaces, one.near[near], one.spacing)


def _pooled(fits: Sequence[Posterior]) -> float:
    total = sum(one.freedom for one in fits)
    return float(np.sqrt(sum(one.freedom * one.deviation**2 for one in fits) / total)) if total else 0.0


def _support(likelihood: Likelihood, motion: Float[np.ndarray, "6"], deviation: float) -> int:
    terms = likelihood.terms(motion[None], np.array([deviation]))
    return int((terms.inside > 0.5).sum())


def _result(touch, one, likelihood, after, errors, centre) -> RegisteredTouch:
    to_touch = np.eye(4)
    to_touch[:3, :3] = one.axes
    to_touch[:3, 3] = one.origin
    local = matrix(after.motion)
    motion = to_touch @ local @ np.linalg.inv(to_touch)  # millimetres, from the centroid
    rotation, shift = motion[:3, :3], motion[:3, 3]
    whole = np.eye(4)
    whole[:3, :3] = rotation
    whole[:3, 3] = centre + shift / touch.unit - rotation @ centre
    kept = errors <= TRUSTED * one.spacing
    support = _support(likelihood, after.motion, after.deviation)
    moved = touch.points @ rotation.T + whole[:3, 3]
    poses = whole @ touch.poses if len(touch.poses) else touch.poses
    verdict = "moved" if kept.all() else "partly" if kept.any() else "refused"
    new = replace(touch, points=moved[kept], finger=touch.finger[kept], poses=poses)
    big = np.zeros((6, 6))
    big[:3, :3] = big[3:, 3:] = one.axes
    covariance = big @ after.covariance @ big.T
    covariance[3:] /= touch.unit
    covariance[:, 3:] /= touch.unit
    return RegisteredTouch(new, whole, covariance, errors[kept] / touch.unit, support, verdict, "")
