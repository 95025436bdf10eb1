"""Upsampling of a cloud of any size to any number of points, patch by patch."""

import functools
import math
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.frames import OwnFrame
from pcsr.geometry.patches import patches
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.candidates import Candidates
from pcsr.upsample.gaps import between, spread_out, within_reach
from pcsr.upsample.unseen import unseen
from pcsr.workers import WorkerPool

FEWEST = 16
"""Smallest number of points of a cloud."""
GAP = 2.0
"""A touched point closer to the cloud than `GAP` local spacings lies in a gap of the cloud, and needs no warning."""
ALONE = WorkerPool(None, 1)
"""The pool of this process alone."""


@dataclass(frozen=True)
class Task:
    """One patch, and the number of new points of its core."""

    points: CloudArray
    core: int
    touches: list[CloudArray]
    count: int


@threads(1)
def densify(
    points: Float[np.ndarray, "n 3"],
    count: int,
    source: Candidates,
    *,
    touches: Sequence[CloudArray] = (),
    keep: bool = True,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Float[np.ndarray, "new 3"]:
    """Generate the points that complete a cloud to `count` points.

    Patches are processed independently. Among the candidates near its core, each patch chooses those that fill the gaps
    best. A core gets new points in proportion to its own number of points, so that relative densities are preserved.
    Touched points in regions without cloud points are subsampled to the cloud's density and added to the cloud.

    Args:
        points: the cloud, (n 3), in any frame and unit; finite.
        count: number of points of the result: old and new ones if `keep`, otherwise new ones alone.
        source: generates the candidates.
        touches: touched points, one array for each touch, in the frame and unit of `points`.
        keep: whether the old points are part of the result.
        pool: processes that work on the patches.
        advance: called after each patch with the number of points processed and the number of all points.

    Returns:
        The new points. Touched points in regions without cloud points come first; the order of the others follows the
        shape of the cloud.

    Raises:
        UserError: too few points, all of them on one spot, or a count that cannot be reached.

    Warns:
        PcsrWarning: there are touched points in regions without cloud points.
    """
    cloud = np.asarray(points, np.float64)
    n = len(cloud)
    if n < FEWEST:
        raise UserError(f"the cloud has {n} points: at least {FEWEST} are needed")
    check_cloud(cloud, extent=True)
    new = count - n if keep else count
    if new < 0:
        raise UserError(
            f"{count} points are fewer than the {n} of the cloud: ask for more, or don't keep the old ones (--replace)"
        )
    parts: list[CloudArray] = []
    touched = unseen(cloud, touches)
    if len(touched):
        _warn_of_unseen(cloud, touched, new)
        parts = [touched[:new]]
        cloud, n, new = np.concatenate([cloud, touched]), n + len(touched), new - len(parts[0])
    while new > source.rate * n:
        # The fewest passes that reach the count, all with the same rate.
        passes = math.ceil(math.log(new / n + 1) / math.log(source.rate + 1))
        step = round(n * (new / n + 1) ** (1 / passes)) - n
        added = _one_pass(cloud, step, source, touches, True, pool, advance)
        if keep:
            parts.append(added)
        cloud, n, new = np.concatenate([cloud, added]), n + step, new - (step if keep else 0)
    parts.append(_one_pass(cloud, new, source, touches, keep, pool, advance))
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def _warn_of_unseen(cloud: CloudArray, touched: CloudArray, new: int) -> None:
    """Warn of touched points away from the cloud: the region may be unseen, or the pose of the sensor wrong."""
    tree = cKDTree(cloud)
    distance, nearest = tree.query(touched)
    spacing = tree.query(cloud[nearest], k=FEWEST)[0].mean(1)
    if new >= len(touched) and (distance <= GAP * spacing).all():
        return
    more = f"; only {new} of them fit into the count, so ask for more points" if new < len(touched) else ""
    warnings.warn(
        f"{len(touched)} touched points lie up to {distance.max():.4g} from the cloud and are added to it as unseen "
        f"surface: if the cloud covers that region, these touches are misplaced{more}",
        PcsrWarning,
        stacklevel=5,
    )


def _one_pass(
    cloud: CloudArray,
    new: int,
    source: Candidates,
    touches: Sequence[CloudArray],
    keep: bool,
    pool: WorkerPool,
    advance: Callable[[int, int], None],
) -> CloudArray:
    done = at = 0
    added = np.zeros((new, 3))
    work = functools.partial(_fill, source, keep)
    cores: deque[int] = deque()
    for filled in pool.map(work, _tasks(cloud, new, source, touches, cores)):
        added[at : at + len(filled)] = filled
        at += len(filled)
        done += cores.popleft()
        advance(done, len(cloud))
    return added


def _tasks(
    cloud: CloudArray, new: int, source: Candidates, touches: Sequence[CloudArray], cores: deque[int]
) -> Iterator[Task]:
    before = 0
    for patch in patches(cloud, source.size, source.size // 2):
        points = cloud[patch.rows]
        share = (before + patch.core) * new // len(cloud) - before * new // len(cloud)
        before += patch.core
        cores.append(patch.core)
        nearby = list(touches) if patch.core == len(cloud) else _touches_within(points, touches)
        yield Task(points, patch.core, nearby, share)


def _touches_within(points: CloudArray, touches: Sequence[CloudArray]) -> list[CloudArray]:
    """Return the touched points within the sphere around a patch, for each touch that has any."""
    centre = points.mean(0)
    radius = np.linalg.norm(points - centre, axis=1).max()
    inside = [touch[np.linalg.norm(touch - centre, axis=1) <= radius] for touch in touches]
    return [touch for touch in inside if len(touch)]


@threads(1)  # a Dask worker sets its own number of threads
def _fill(source: Candidates, keep: bool, task: Task) -> CloudArray:
    """Generate the new points of a patch's core, in the patch's own frame."""
    if task.count == 0:
        return np.zeros((0, 3))
    frame = OwnFrame.of(task.points)
    points = frame.normalize(task.points)
    order = np.concatenate([_sorted(points[: task.core]), task.core + _sorted(points[task.core :])])
    points = points[order]
    candidates = source(points, [frame.normalize(touch) for touch in task.touches])
    valid, distance, nearest = within_reach(candidates, points)
    candidates, distance, in_core = candidates[valid], distance[valid], nearest[valid] < task.core
    chosen = candidates[spread_out(candidates, distance if keep else None, in_core, task.count)]
    missing = between(points, task.core, task.count - len(chosen))
    return frame.denormalize(np.concatenate([chosen, missing]))


def _sorted(points: CloudArray) -> Int[np.ndarray, " n"]:
    """Return the lexicographic order of points."""
    return np.lexsort(points.T)
