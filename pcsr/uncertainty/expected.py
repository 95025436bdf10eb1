"""Expected errors of new points, patch by patch."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.clouds.convert import convert
from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.geometry.patches import patches
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.uncertainty.features import PREDICTED, Patch, features, of_prediction
from pcsr.uncertainty.fitted import fitted_networks
from pcsr.upsample.dense import ALONE, FEWEST
from pcsr.workers import WorkerPool

FAR = 5.0
"""Farther than this from all known points, in spacings, nothing is known: the error is at least the distance beyond."""
SIZE, CORE = 4096, 3000
"""Number of known points of a patch, and of its core."""


@dataclass(frozen=True)
class ExpectedErrors:
    """Expected errors, one standard deviation each, in the unit of the cloud."""

    new: Float[np.ndarray, " m"]
    """Error of each new point."""
    known: Float[np.ndarray, " n"]
    """Error of each known point: the estimated noise around it, 0 where none differs from details."""


def expected_errors(points: Any, new: Any, *, predicted: Any = None) -> Float[np.ndarray, " m"]:
    """Predict the error of each point that an upsampling method added to a cloud.

    The error of a point is its distance from the true surface. Predicted is one standard deviation: 68 % of the points
    of a predicted error are at most that far from the surface. The prediction is fitted to points of several networks
    and of interpolation on generated shapes, with and without noise (docs/confidence.md).

    Args:
        points: the cloud that was upsampled, (n 3), at least 16 points: a numpy array, a torch tensor, a trimesh or an
            Open3D cloud, or a `pcsr.clouds.cloud.Cloud`.
        new: the points that were added, (m 3), in the frame and unit of `points`.
        predicted: distance from the surface that the method itself expects of each new point, (m), if it does; 0 where
            it does not. It is fitted to the errors that the model `field` predicts.

    Returns:
        The expected error of each new point, (m), in the unit of `points`.

    Raises:
        UserError: the points are too few, not finite or all equal, or the numbers of rows differ.

    Examples:
        >>> rng = np.random.default_rng(0)
        >>> floor = np.column_stack([rng.uniform(0, 10, (500, 2)), np.zeros(500)])
        >>> new = np.array([[5.0, 5.0, 0.0], [5.0, 5.0, 0.3]])
        >>> on, off = pcsr.expected_errors(floor, new)
        >>> bool(on < 0.1 < off)
        True
    """
    cloud, added = (np.asarray(convert(one).cloud.points) for one in (points, new))
    errors = np.zeros(len(added)) if predicted is None else np.asarray(predicted, np.float64)
    if errors.shape != (len(added),):
        raise UserError(f"predicted has shape {errors.shape} for {len(added)} new points: give one number for each")
    if not (np.isfinite(errors).all() and (errors >= 0).all()):
        raise UserError("predicted has numbers that are negative or not finite: give 0 where no error is predicted")
    return errors_of(np.unique(cloud, axis=0), added, errors).new


@threads(1)
def errors_of(
    points: Float[np.ndarray, "n 3"],
    new: Float[np.ndarray, "m 3"],
    predicted: Float[np.ndarray, " m"],
    *,
    removed: float = 0.0,
    core: int | None = None,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> ExpectedErrors:
    """Predict the errors of new points and of the known points.

    Args:
        points: the known points, (n 3), in any frame and unit, without duplicates.
        new: the new points, (m 3), in the frame and unit of `points`.
        predicted: error that the upsampling network predicts of each, (m); 0 where it predicts none.
        removed: standard deviation of the noise that was removed from the known points.
        core: number of points, at the beginning of `points`, to which the new points belong. The others are their
            neighbourhood, and have no error.
        pool: processes that work on the patches.
        advance: called with the number of known points that are done, and of all.

    Raises:
        UserError: too few points, or points that are not finite or all equal.
    """
    cloud, new = np.asarray(points, np.float64), np.asarray(new, np.float64)
    if len(cloud) < FEWEST:
        raise UserError(f"the cloud has {len(cloud)} points: at least {FEWEST} are needed")
    check_cloud(cloud, extent=True)
    if len(new):
        check_cloud(new, "the new points")
    n = len(cloud) if core is None else core
    power = exponent([cloud, new])
    cloud, new = scaled(cloud, -power), scaled(new, -power)
    rated, less = scaled(predicted, -power), float(np.ldexp(removed, -power))
    owner = cKDTree(cloud[:n]).query(new)[1] if len(new) else np.zeros(0, np.int64)
    found, levels, done = np.zeros(len(new)), np.zeros(n), 0
    rows: list[tuple[Int[np.ndarray, " c"], Int[np.ndarray, " k"]]] = []
    for errors, level in pool.map(_errors, _tasks(cloud, new, rated, owner, n, less, rows)):
        of_new, of_core = rows.pop(0)
        found[of_new], levels[of_core] = errors, level
        done += len(of_core)
        advance(done, n)
    return ExpectedErrors(scaled(found, power), scaled(levels, power))


@dataclass(frozen=True)
class _Task:
    """One patch of the known points, with the new points on it."""

    patch: Patch
    chosen: Int[np.ndarray, " c"]
    """Rows of the new points of the core."""
    predicted: Float[np.ndarray, " c"]
    """Predicted errors of these."""


def _tasks(
    cloud: CloudArray,
    new: CloudArray,
    predicted: Float[np.ndarray, " m"],
    owner: Int[np.ndarray, " m"],
    core: int,
    removed: float,
    rows: list[tuple[Int[np.ndarray, " c"], Int[np.ndarray, " k"]]],
) -> Iterator[_Task]:
    """Yield a task for each patch, and append the rows of its new points and of its core to `rows`."""
    order = np.argsort(owner, kind="stable")
    ends = np.searchsorted(owner[order], np.arange(core + 1))
    for patch in patches(cloud, SIZE, CORE, np.arange(core)):
        members = np.concatenate([order[ends[row] : ends[row + 1]] for row in patch.rows if row < core])
        count = int(np.diff(ends)[patch.rows[: patch.core]].sum())
        known, around = cloud[patch.rows], new[members]
        centre = known.mean(0)
        rows.append((members[:count], patch.rows[: patch.core]))
        yield _Task(Patch(known - centre, around - centre, removed), np.arange(count), predicted[members[:count]])


@threads(1)  # a Dask worker sets its own number of threads
def _errors(task: _Task) -> tuple[Float[np.ndarray, " c"], float]:
    """Return the errors of a task's new points, and the noise of its known points."""
    errors = np.zeros(len(task.chosen))
    if len(errors):
        networks = fitted_networks()
        found, unit = features(task.patch, task.chosen)
        rated = task.predicted > 0
        errors[~rated] = networks.plain({name: values[~rated] for name, values in found.items()})
        found[PREDICTED] = of_prediction(task.predicted, unit)
        errors[rated] = networks.rated({name: values[rated] for name, values in found.items()})
        errors *= unit
        distance, _ = task.patch.neighbours.tree.query(task.patch.new[task.chosen])
        errors = np.maximum(errors, distance - FAR * unit)
    return errors, task.patch.level
