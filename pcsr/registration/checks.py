"""Checks of what a registration is given: touches, a cloud, and the error of the poses."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.convert import convert
from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud

LARGEST_TOUCH = 1e5
"""Largest diameter of a touch, in millimetres."""
LARGEST_RANGE = 1e12
"""Largest distance from the centroid of the cloud, in millimetres."""
SMALLEST_CLOUD = 1e-9
"""Smallest distance of a point from the centroid of the cloud, in millimetres, if the points are not all equal."""
RECORDS = "give a list of pcsr.Touch records, such as pcsr.recorded.read(folder).touches"


def checked(
    touches: Any, cloud: Any, pose_error: PoseError | None
) -> tuple[list[Touch], Float[np.ndarray, "n 3"], PoseError]:
    """Return the touches as a list, the cloud as an array of doubles, and the error of the poses.

    Args:
        touches: touches of one recording.
        cloud: points of any type that `convert` supports.
        pose_error: error of the poses; None for the default.

    Raises:
        UserError: one of them has another type, is empty, not finite, or of a size that only a wrong unit explains; or
            the touches have different units.
    """
    if isinstance(touches, str) or not isinstance(touches, Iterable):
        raise UserError(f"a {type(touches).__name__} is no list of touches: {RECORDS}")
    records = list(touches)
    error = PoseError() if pose_error is None else pose_error
    if not isinstance(error, PoseError):
        raise UserError(f"pose_error is a {type(error).__name__}: give a pcsr.PoseError(position=…, rotation=…)")
    points = convert(cloud).cloud.points
    check_cloud(points)
    for number, touch in enumerate(records):
        if not isinstance(touch, Touch):
            raise UserError(f"touch {number} is a {type(touch).__name__}: {RECORDS}")
        _check(touch, f"touch {number}")
    if len({touch.unit for touch in records}) > 1:
        raise UserError(f"touches of one recording need the same unit, got {[touch.unit for touch in records]} mm")
    _check_sizes(records, points)
    return records, points, error


def _check(touch: Touch, name: str) -> None:
    points, poses, view = np.asarray(touch.points), np.asarray(touch.poses), touch.view
    if not isinstance(touch.points, np.ndarray) or points.shape[1:] != (3,) or points.dtype.kind not in "iuf":
        raise UserError(f"{name}: points are a {type(touch.points).__name__} {points.shape}: give an array (m, 3)")
    if len(points) == 0 or not np.isfinite(points).all():
        raise UserError(f"{name} has {len(points)} points, which must be some and finite")
    if not _positive([touch.unit]):
        raise UserError(f"{name}: unit is {touch.unit!r}: it must be the length of its unit in mm, more than 0")
    if view is not None and (np.shape(view) != (2,) or not _positive(view)):
        raise UserError(f"{name}: view is {view!r}: it must be two sides in mm, more than 0")
    if touch.errors is not None and not _errors_of(touch.errors, len(points)):
        raise UserError(f"{name}: errors must be {len(points)} numbers, one for each point, finite and 0 or more")
    regular = poses.shape[1:] == (4, 4) and np.isfinite(poses).all()
    if not regular or any(np.linalg.matrix_rank(pose[:3, :3]) < 3 for pose in poses):
        raise UserError(
            f"{name}: a pose is no 4x4 matrix of finite numbers with a rotation: leave poses empty if unknown"
        )


def _errors_of(errors: Any, count: int) -> bool:
    numbers = np.asarray(errors)
    if numbers.shape != (count,) or numbers.dtype.kind not in "iuf":
        return False
    return bool((np.isfinite(numbers) & (numbers >= 0)).all())


def _positive(numbers: Any) -> bool:
    return all(isinstance(one, int | float | np.number) and 0 < one < np.inf for one in numbers)


def _check_sizes(touches: list[Touch], cloud: Float[np.ndarray, "n 3"]) -> None:
    """Check that lengths in millimetres are some that a finger and a camera can have."""
    if not touches:
        return
    unit = touches[0].unit
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        centre = cloud.mean(0)
        reach = float(np.abs(cloud - centre).max() * unit)
        away = [float(np.abs(touch.points - centre).max() * unit) for touch in touches]
        sizes = [float(np.ptp(touch.points, axis=0).max() * unit) for touch in touches]
    if not reach <= LARGEST_RANGE or (reach < SMALLEST_CLOUD and (cloud != cloud[0]).any()):
        raise UserError(f"the cloud is {2 * reach:.3g} mm across at a unit of {unit:g} mm: correct the touches' unit")
    for number, (size, distance) in enumerate(zip(sizes, away, strict=True)):
        if not size <= LARGEST_TOUCH:
            raise UserError(f"touch {number} is {size:.3g} mm across at a unit of {unit:g} mm: correct its unit")
        if not distance <= LARGEST_RANGE:
            raise UserError(f"touch {number} is {distance:.3g} mm from the cloud's centroid: correct its unit or frame")
