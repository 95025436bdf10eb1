"""Results of the registration of touches to a cloud."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from pcsr.clouds.touch import Touch

Verdict = Literal["kept", "moved", "partly", "refused"]


@dataclass(frozen=True)
class RegisteredTouch:
    """One touch after the registration.

    Examples:
        >>> reported = pcsr.Touch.single(np.random.default_rng(0).normal(size=(9, 3)), None, unit=1.0, sensor="digit")
        >>> cloud = np.random.default_rng(1).normal(size=(50, 3)) * [9, 9, 0.1] - [0, 0, 50]
        >>> one = pcsr.register([reported], cloud).touches[0]
        >>> one.verdict, one.reason
        ('kept', 'no point of the cloud lies on it, so that it cannot be checked')
        >>> one.motion.shape, one.covariance.shape, one.errors.shape, one.support
        ((4, 4), (6, 6), (9,), 0)
    """

    touch: Touch
    """The touch with its corrected pose and the points that can be trusted; without points if it is refused."""
    motion: Float[np.ndarray, "4 4"]
    """Rigid motion from the reported points to the corrected ones, in the frame and unit of the cloud."""
    covariance: Float[np.ndarray, "6 6"]
    """Covariance of the error that is left: a rotation vector about the touch's centroid, in radians, then a
    translation, in the unit of the cloud."""
    errors: Float[np.ndarray, " m"]
    """Expected error of each point of `touch`, one standard deviation, in the unit of the cloud."""
    support: int
    """Number of points of the cloud on the touched surface."""
    verdict: Verdict
    """`kept`: where the robot reported it; `moved`; `partly`: some of its points are left out; `refused`: all are."""
    reason: str
    """Reason of the verdict, in words."""


@dataclass(frozen=True)
class Registration:
    """Touches of a recording, registered to a cloud.

    Examples:
        >>> reported = pcsr.Touch.single(np.random.default_rng(0).normal(size=(9, 3)), None, unit=1.0, sensor="digit")
        >>> cloud = np.random.default_rng(1).normal(size=(50, 3)) + 100
        >>> exact = pcsr.register([reported], cloud, pose_error=pcsr.PoseError(position=0.0, rotation=0.0))
        >>> [one.reason for one in exact.touches], exact.shared_error, exact.private_error
        (['its pose is exact'], 0.0, 0.0)
        >>> used = [one.touch for one in exact.touches if one.verdict != "refused"]
    """

    touches: list[RegisteredTouch]
    offset: Float[np.ndarray, "4 4"]
    """Rigid motion that all touches share, in the frame and unit of the cloud; the identity if there is none."""
    offset_covariance: Float[np.ndarray, "6 6"]
    """Covariance of the offset's error: a rotation vector about the cloud's centroid, then a translation."""
    shared_error: float
    """Estimated standard deviation of the shared part of the position errors, in millimetres."""
    private_error: float
    """Estimated standard deviation of the position error of each touch by itself, in millimetres."""
