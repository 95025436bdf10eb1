"""Expected errors of a cloud that was upsampled: of its given points, of new ones, and of touched ones among these."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from pcsr.clouds.faults import ScreenedCloud
from pcsr.tensors import CloudArray
from pcsr.uncertainty.expected import ExpectedErrors, errors_of
from pcsr.upsample.candidates import Generated
from pcsr.upsample.dense import ALONE
from pcsr.workers import WorkerPool

SAME = 1e-6
"""Largest distance of a touched point among the new points from the touch, in extents of the cloud: networks have
single precision."""
LEFT = 0.5
"""Error of a point from which noise was removed, in standard deviations of the noise."""


def upsampled_errors(
    points: Float[np.ndarray, "n 3"],
    new: Generated,
    *,
    touches: Sequence[CloudArray] = (),
    touch_errors: Sequence[Float[np.ndarray, " _"]] = (),
    removed: float = 0.0,
    core: int | None = None,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> ExpectedErrors:
    """Predict the errors of the points of an upsampled cloud.

    A touched point has the error of its touch. It counts as a known point, and a new point next to it has its error and
    the predicted one, as errors that are independent.

    Args:
        points: the cloud that was upsampled, (n 3), without duplicates.
        new: the new points, with the errors that the network predicts of them.
        touches: touched points, one array for each touch, in the frame and unit of `points`.
        touch_errors: expected error of each of them; NaN where it is unknown.
        removed: standard deviation of the noise that was removed from the points.
        core: as of `errors_of`.
        pool: processes that work on the patches.
        advance: called with the number of known points that are done, and of all.

    Returns:
        The errors of the new points, NaN where that of a touched point is unknown, and of the cloud's points.
    """
    touched, of_touch = _touched(points, new.points, touches, touch_errors)
    made = ~touched
    n = len(points) if core is None else core
    known = np.concatenate([points[:n], new.points[touched], points[n:]])
    found = errors_of(
        known,
        new.points[made],
        new.errors[made],
        removed=removed,
        core=n + int(touched.sum()),
        pool=pool,
        advance=advance,
    )
    errors = of_touch
    errors[made] = found.new
    if touched.any():
        inherited = np.concatenate([np.zeros(n), np.nan_to_num(of_touch[touched], nan=0.0)])
        nearest = cKDTree(known[: len(inherited)]).query(new.points[made])[1]
        errors[made] = np.hypot(found.new, inherited[nearest])
    return ExpectedErrors(errors, np.maximum(found.known[:n], LEFT * removed))


def given_errors(given: ScreenedCloud, errors: Float[np.ndarray, " used"]) -> Float[np.ndarray, " n"]:
    """Return the errors of all points of a cloud from those of its used ones.

    Copies of a used point have its error; that of other points which are not used is unknown, NaN.
    """
    every = np.full(len(given.used), np.nan)
    every[given.used] = errors
    unused = np.flatnonzero(~given.used & np.isfinite(given.cloud.points).all(1))
    if len(unused):
        distance, nearest = cKDTree(given.points).query(given.cloud.points[unused])
        copies = distance <= SAME * float(np.ptp(given.points, axis=0).max())
        every[unused[copies]] = errors[nearest[copies]]
    return every


def _touched(
    points: CloudArray,
    new: CloudArray,
    touches: Sequence[CloudArray],
    touch_errors: Sequence[Float[np.ndarray, " _"]],
) -> tuple[Bool[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return which new points are touched points, and their errors; NaN for the others."""
    errors = np.full(len(new), np.nan)
    if not touches or not len(new):
        return np.zeros(len(new), bool), errors
    every, known = np.concatenate(touches), np.concatenate(touch_errors)
    distance, nearest = cKDTree(every).query(new)
    touched = distance <= SAME * float(np.ptp(points, axis=0).max())
    errors[touched] = known[nearest[touched]]
    return touched, errors
