"""A cloud of any size to any number of points, patch by patch."""

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
"""Points that a cloud must have."""
GAP = 2.0
"""A touch is in a gap of the cloud, which is no news, if it is no farther away than so many mean distances there."""
ALONE = WorkerPool(None, 1)


@dataclass(frozen=True)
class Task:
    """One patch, and how many new points its core is to get."""

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
    """The points that make a cloud one of `count`.

    Patches are independent of each other: each chooses, among the candidates nearest to its core's points, those that
    fill the gaps best. Each core gets new points in proportion to its own, so the cloud's density keeps its pattern.
    Where the cloud has no points but something was touched, a few touched points are treated as points of the cloud.

    Args:
        points: the cloud, in any frame and unit; finite.
        count: points in all: the old and the new, or the new alone.
        source: where candidates come from.
        touches: touched points in the frame and unit of `points`.
        keep: whether the old points are among the `count`.
        pool: who works on the patches.
        advance: called after each patch, with the points of the cloud that are done and all of them.

    Returns:
        The new points: `count` less the cloud's if these are kept. Touched points where the cloud had none come first,
        then the order follows the cloud's shape.

    Raises:
        UserError: too few points, all of them on one spot, or a count that cannot be reached.

    Warns:
        PcsrWarning: something was touched where the cloud has no points.
    """
    cloud = np.asarray(points, np.float64)
    n = len(cloud)
    if n < FEWEST:
        raise UserError(f"the cloud has {n} points: at least {FEWEST} are needed to know a surface by")
    check_cloud(cloud, extent=True)
    new = count - n if keep else count
    if new < 0:
        raise UserError(
            f"{count} points were asked of a cloud of {n}: ask for more, or don't keep the old ones (--replace)"
        )
    made: list[CloudArray] = []
    touched = unseen(cloud, touches)
    if len(touched):
        _warn_of_unseen(cloud, touched, new)
        made = [touched[:new]]
        cloud, n, new = np.concatenate([cloud, touched]), n + len(touched), new - len(made[0])
    while new > source.rate * n:  # in as many passes as it takes
        # Equal steps, each as large as the source can go.
        passes = math.ceil(math.log(new / n + 1) / math.log(source.rate + 1))
        step = round(n * (new / n + 1) ** (1 / passes)) - n
        added = _one_pass(cloud, step, source, touches, True, pool, advance)
        if keep:
            made.append(added)
        cloud, n, new = np.concatenate([cloud, added]), n + step, new - (step if keep else 0)
    made.append(_one_pass(cloud, new, source, touches, keep, pool, advance))
    return np.concatenate(made) if len(made) > 1 else made[0]


def _warn_of_unseen(cloud: CloudArray, touched: CloudArray, new: int) -> None:
    """What is taken for unseen may be seen, and the arm be wrong: nothing but the distance tells."""
    tree = cKDTree(cloud)
    distance, nearest = tree.query(touched)
    spacing = tree.query(cloud[nearest], k=FEWEST)[0].mean(1)
    if new >= len(touched) and (distance <= GAP * spacing).all():
        return
    more = f"; only {new} of them fit into the count, so ask for more points" if new < len(touched) else ""
    warnings.warn(
        f"{len(touched)} touched points, up to {distance.max():.4g} away from the cloud, are taken for a part of the "
        f"surface that it does not show: if it does show it there, these touches are misplaced{more}",
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
    made = np.zeros((new, 3))
    work = functools.partial(_fill, source, keep)
    cores: deque[int] = deque()
    for filled in pool.map(work, _tasks(cloud, new, source, touches, cores)):
        made[at : at + len(filled)] = filled
        at += len(filled)
        done += cores.popleft()
        advance(done, len(cloud))
    return made


def _tasks(
    cloud: CloudArray, new: int, source: Candidates, touches: Sequence[CloudArray], cores: deque[int]
) -> Iterator[Task]:
    before = 0
    for patch in patches(cloud, source.size, source.size // 2):
        points = cloud[patch.rows]
        share = (before + patch.core) * new // len(cloud) - before * new // len(cloud)
        before += patch.core
        cores.append(patch.core)
        met = list(touches) if patch.core == len(cloud) else _met(points, touches)
        yield Task(points, patch.core, met, share)


def _met(points: CloudArray, touches: Sequence[CloudArray]) -> list[CloudArray]:
    """What the patch has of each touch that reaches into it."""
    centre = points.mean(0)
    radius = np.linalg.norm(points - centre, axis=1).max()
    inside = [touch[np.linalg.norm(touch - centre, axis=1) <= radius] for touch in touches]
    return [touch for touch in inside if len(touch)]


@threads(1)  # a Dask worker has its own; where `densify` has set it already this costs nothing
def _fill(source: Candidates, keep: bool, task: Task) -> CloudArray:
    """The new points of one patch's core, found in the patch's own frame."""
    if task.count == 0:
        return np.zeros((0, 3))
    frame = OwnFrame.of(task.points)
    points = frame.normalize(task.points)
    order = np.concatenate([_sorted(points[: task.core]), task.core + _sorted(points[task.core :])])
    points = points[order]
    candidates = source(points, [frame.normalize(touch) for touch in task.touches])
    close, distance, nearest = within_reach(candidates, points)
    candidates, distance, mine = candidates[close], distance[close], nearest[close] < task.core
    chosen = candidates[spread_out(candidates, distance if keep else None, mine, task.count)]
    missing = between(points, task.core, task.count - len(chosen))
    return frame.denormalize(np.concatenate([chosen, missing]))


def _sorted(points: CloudArray) -> Int[np.ndarray, " n"]:
    """An order that does not hang on the one that the points came in."""
    return np.lexsort(points.T)
