"""Registration of touches to a cloud: the poses of a robot's arm are corrected by the points that a camera saw."""

from pcsr.registration.records import RegisteredTouch, Registration, Verdict
from pcsr.registration.register import register

__all__ = ["RegisteredTouch", "Registration", "Verdict", "register"]
