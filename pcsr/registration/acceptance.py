"""Which touched points are used: those that are more exact than the cloud, of touches that agree with it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from pcsr.registration.fit import Posterior, Prior
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import moved, moved_back
from pcsr.registration.neighbourhood import Neighbourhood
from pcsr.registration.records import Verdict

TRUSTED = 0.12
"""Error of a surface through the cloud, in spacings of the cloud."""
REACH = 3.0
"""Beyond this distance from the cloud, in spacings, a surface is not seen."""
UNSEEN = 0.15
"""Largest expected error of a touched point there, as a share of its distance from the cloud."""
FULL = 0.6
"""Share of the expected number of points on the touched surface that speaks for it fully; with fewer, less error is
allowed in proportion."""
BEHIND = 5.0
"""A point of the cloud this many deviations behind the touch belongs to another surface."""
IN_FINGER = 3
"""Number of points of the cloud that may lie where the finger was: strays."""
SHARE_IN_FINGER = 0.15
"""The same, as a share of the points on the touched surface."""
FARTHEST = 22.5
"""Largest squared distance of a motion from what is expected of the arm, in deviations: the 0.999 quantile of the χ²
distribution with 6 degrees of freedom."""
STILL = 0.02
"""Motions by less than this, in millimetres, are not made."""


@dataclass(frozen=True)
class Judgement:
    """Verdict on one touch."""

    verdict: Verdict
    reason: str
    kept: Bool[np.ndarray, " m"]
    """Which points are used."""
    support: int
    """Number of points of the cloud on the touched surface."""


def judge(
    one: Neighbourhood,
    likelihood: Likelihood,
    prior: Prior,
    after: Posterior,
    errors: Float[np.ndarray, " m"],
    *,
    all_sides: bool = False,
) -> Judgement:
    """Decide which points of a touch are used.

    Args:
        one: the touch and the cloud around it.
        likelihood: of the touch's motion.
        prior: distribution of the motion before the cloud was looked at.
        after: distribution of the motion.
        errors: expected error of each touched point, in millimetres.
        all_sides: whether the cloud shows the object from all sides.
    """
    here = moved(one.points, after.motion)
    shift = float(np.sqrt(((here - one.points) ** 2).sum(1).mean()))
    none = np.zeros(len(here), bool)
    terms = likelihood.terms(after.motion[None], np.array([after.deviation]))
    support = int((terms.inside[0, : likelihood.of_cloud] > 0.5).sum())
    in_finger = int((terms.against[0, : likelihood.of_cloud] < np.log(0.1)).sum())
    if in_finger > max(IN_FINGER, SHARE_IN_FINGER * support):
        return Judgement("refused", f"{in_finger} points of the cloud lie where the finger was", none, support)
    away = after.motion - prior.mean
    if away @ np.linalg.solve(prior.covariance, away) > FARTHEST:
        return Judgement(
            "refused",
            f"it would have to move by {shift:.2f} mm, more than the error of the arm explains",
            none,
            support,
        )
    wanted = FULL * likelihood.expected
    agreement = min(1.0, terms.inside.sum() / wanted) if wanted else 1.0
    unseen = 0.0 if all_sides else UNSEEN * agreement if support else UNSEEN
    allowed = _allowed(one, after, here, TRUSTED * agreement * one.spacing, unseen)
    kept = errors <= allowed
    if not kept.any() and one.surfaces and not support:
        return Judgement("refused", "no point of the cloud lies on it, though the cloud is seen there", kept, support)
    if not kept.any():
        reason = (
            f"its expected error, {np.median(errors):.2g} mm, exceeds that of the cloud, {np.median(allowed):.2g} mm"
        )
        return Judgement("refused", reason, kept, support)
    if not kept.all():
        few = _counted(int((~kept).sum()))
        reason = f"at {few} the expected error exceeds that of the cloud, {np.median(allowed):.2g} mm"
        return Judgement("partly", reason, kept, support)
    if not one.surfaces:
        reason = "its points make no surface, so that it cannot be checked"
    elif support:
        reason = f"{_counted(support)} of the cloud {'lies' if support == 1 else 'lie'} on it"
    else:
        reason = "no point of the cloud lies on it, so that it cannot be checked"
    return Judgement("kept" if shift < STILL else "moved", reason, kept, support)


def _counted(count: int) -> str:
    return f"{count} point{'' if count == 1 else 's'}"


def _allowed(
    one: Neighbourhood, after: Posterior, here: Float[np.ndarray, "m 3"], seen: float, unseen: float
) -> Float[np.ndarray, " m"]:
    """Return the error of the cloud at each touched point, in millimetres.

    Where the cloud has points, it is a share of their spacing; elsewhere the cloud tells nothing, and it is a share of
    the distance from the cloud. Points so far behind the contact that the error of the pose doesn't explain it are of
    another surface, such as the far side.

    Args:
        one: the touch and the cloud around it.
        after: distribution of its motion.
        here: touched points where the motion puts them.
        seen: error of the cloud where it has points.
        unseen: error where it has none, as a share of the distance; 0 if the cloud shows all sides.
    """
    back = moved_back(one.near, after.motion[None])
    distances = [surface.find(back)[0][0] for surface in one.surfaces]
    distance = np.max(distances, axis=0) if distances else np.zeros(len(one.near))
    across = BEHIND * np.sqrt(after.covariance[5, 5] + after.deviation**2)
    near = one.near if unseen == 0 else one.near[distance > -across]
    if len(near) == 0:
        return np.full(len(here), seen if unseen == 0 else np.inf)
    away = cKDTree(near).query(here)[0]
    allowed: Float[np.ndarray, " m"] = np.where(away <= REACH * one.spacing, seen, np.maximum(seen, unseen * away))
    return allowed
