"""Results of a registration for readers: a table, sentences, and a document of plain data."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.registration.records import RegisteredTouch, Registration

HEADS = ("touch", "verdict", "moved mm", "turned °", "support", "error mm", "reason")
"""Heads of the table."""
NUMBERS = frozenset(HEADS[2:6])
"""Those of numbers."""
FARTHER = 12.6
"""Squared distance in deviations from which on an offset differs from 0: the 0.95 quantile of the χ² distribution with
6 degrees of freedom."""
UNITS = {
    "motion": "rigid motion of points in the frame and unit of the cloud, from reported to corrected points",
    "covariance": "rotation vector about the centroid of the touch's points in radians, then translation in the unit "
    "of the cloud",
    "offset": "as motion, of all touches",
    "offset_covariance": "rotation vector about the centroid of the cloud's points in radians, then translation in the "
    "unit of the cloud",
    "moved": "mm",
    "turned": "degrees",
    "expected_error": "mm",
    "shared_error": "mm",
    "private_error": "mm",
}
"""Meaning and unit of the numbers in the document."""


def displacement(motion: Float[np.ndarray, "4 4"], at: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return by how much a rigid motion displaces a point."""
    return np.asarray(motion[:3, :3] @ at + motion[:3, 3] - at)


def turn(motion: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "3"]:
    """Return the rotation vector of a rigid motion, in degrees."""
    return np.asarray(Rotation.from_matrix(motion[:3, :3]).as_rotvec(degrees=True))


def expected_error(one: RegisteredTouch) -> float:
    """Return the root mean square of the expected errors of a touch's points, in millimetres; NaN without points."""
    return float(np.sqrt((one.errors**2).mean())) * one.touch.unit if len(one.errors) else math.nan


def remaining_error(registration: Registration) -> PoseError | None:
    """Return the error of the corrected poses; None if it is not known, or no touch is left.

    It is the root mean square over the axes of all touches that are not refused.
    """
    used = [one for one in registration.touches if one.verdict != "refused"]
    if not used:
        return None
    variances = np.array([np.diag(one.covariance) * ([1] * 3 + [one.touch.unit**2] * 3) for one in used])
    rotation, position = (float(np.sqrt(part.mean())) for part in np.split(variances, 2, axis=1))
    if not np.isfinite([rotation, position]).all():
        return None
    return PoseError.at_most(position, math.degrees(rotation))


def table(names: Sequence[str], reported: Sequence[Touch], registration: Registration) -> list[tuple[str, ...]]:
    """Return the rows of a table, a text for each of `HEADS`.

    Args:
        names: name of each touch.
        reported: the touches that were registered.
        registration: their registration.
    """
    return [_row(*one) for one in zip(names, reported, registration.touches, strict=True)]


def _row(name: str, reported: Touch, one: RegisteredTouch) -> tuple[str, ...]:
    support, error = str(one.support), expected_error(one)
    partly = f"partly, {len(one.touch.points)} of {len(reported.points)} points"
    verdict = partly if one.verdict == "partly" else str(one.verdict)
    if one.verdict == "refused":
        return name, verdict, "–", "–", support, "–", one.reason
    moved = np.linalg.norm(displacement(one.motion, reported.points.mean(0))) * reported.unit
    return name, verdict, f"{moved:.2f}", f"{np.linalg.norm(turn(one.motion)):.2f}", support, f"{error:.2f}", one.reason


def sentences(registration: Registration, cloud: Float[np.ndarray, "n 3"], unit: float) -> list[str]:
    """Return what is said of all touches: their shared offset, and the error of the poses.

    Args:
        registration: the registration.
        cloud: the points that the touches were registered to.
        unit: unit of the cloud in millimetres.
    """
    centre = cloud.mean(0)
    shift, turned = displacement(registration.offset, centre), turn(registration.offset)
    said = ["the touches share no offset that differs from 0"]
    if _differs(np.concatenate([np.radians(turned), shift]), registration.offset_covariance):
        (x, y, z), (a, b, c) = shift * unit, turned
        deviation = np.sqrt(np.diag(registration.offset_covariance).clip(0))
        said = [
            f"all touches share an offset of {x:z.3f} {y:z.3f} {z:z.3f} mm and {a:z.3f} {b:z.3f} {c:z.3f} degrees: "
            f"correct the arm by this translation and this rotation vector about "
            f"{' '.join(f'{v:.6g}' for v in centre)}, the centroid of the cloud, all in its frame; they are known to "
            f"{np.linalg.norm(deviation[3:]) * unit:.2g} mm and {np.degrees(np.linalg.norm(deviation[:3])):.2g} degrees"
        ]
    return [
        *said,
        f"position error of the reported poses: {registration.shared_error:.2g} mm that all touches share, "
        f"{registration.private_error:.2g} mm of each touch by itself",
    ]


def _differs(motion: Float[np.ndarray, "6"], covariance: Float[np.ndarray, "6 6"]) -> bool:
    """Return whether a motion differs from none by more than its error explains."""
    if not motion.any():
        return False
    return bool(motion @ np.linalg.pinv(covariance, hermitian=True) @ motion > FARTHER or not covariance.any())


def document(names: Sequence[str], reported: Sequence[Touch], registration: Registration) -> dict[str, Any]:
    """Return the registration as plain data for a JSON file; numbers that are not finite are None.

    Args:
        names: name of each touch.
        reported: the touches that were registered, with the same unit.
        registration: their registration.
    """
    return {
        "format": 1,
        "units": {**UNITS, "cloud": f"{reported[0].unit:.12g} mm" if reported else None},
        "touches": [_entry(*one) for one in zip(names, reported, registration.touches, strict=True)],
        "offset": _plain(registration.offset),
        "offset_covariance": _plain(registration.offset_covariance),
        "shared_error": _plain(registration.shared_error),
        "private_error": _plain(registration.private_error),
    }


def _entry(name: str, reported: Touch, one: RegisteredTouch) -> dict[str, Any]:
    return {
        "name": name,
        "verdict": one.verdict,
        "reason": one.reason,
        "moved": _plain(displacement(one.motion, reported.points.mean(0)) * reported.unit),
        "turned": _plain(turn(one.motion)),
        "motion": _plain(one.motion),
        "covariance": _plain(one.covariance),
        "support": one.support,
        "points_used": len(one.touch.points),
        "points": len(reported.points),
        "expected_error": _plain(expected_error(one)),
    }


def _plain(value: Any) -> Any:
    """Return an array as nested lists and a number as a float, with None for what is not finite."""
    if isinstance(value, np.ndarray):
        return [_plain(part) for part in value]
    return float(value) if math.isfinite(value) else None
