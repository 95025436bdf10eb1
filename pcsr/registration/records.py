"""Results of the registration of touches to a cloud."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from pcsr.clouds.touch import Touch

Verdict = Literal["kept", "moved", "partly", "refused"]


@dataclass(frozen=True)
class RegisteredTouch:
    """One touch after the registration."""

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
    """Touches of a recording, registered to a cloud."""

    touches: list[RegisteredTouch]
    offset: Float[np.ndarray, "4 4"]
    """Rigid motion that all touches share, in the frame and unit of the cloud; the identity if there is none."""
    offset_covariance: Float[np.ndarray, "6 6"]
    """Covariance of the offset's error: a rotation vector about the cloud's centroid, then a translation."""
    shared_error: float
    """Estimated standard deviation of the shared part of the position errors, in millimetres."""
    private_error: float
    """Estimated standard deviation of the position error of each touch by itself, in millimetres."""
