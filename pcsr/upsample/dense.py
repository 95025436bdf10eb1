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
from pcsr.geometry.patches import patches
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.candidates import Candidates
from pcsr.upsample.patch import Task, fill
from pcsr.upsample.unseen import unseen
from pcsr.workers import WorkerPool

FEWEST = 16
"""Smallest number of points of a cloud."""
GROWTH = 4.0
"""Largest growth of the cloud in one pass, if the source generates any number of candidates."""
RATE, LAST_RATE = 4, 8
"""Candidates for each point then: few, which lie well, before the last pass; many to choose from in the last."""
GAP = 2.0
"""A touched point closer to the cloud than `GAP` local spacings lies in a gap of the cloud, and needs no warning."""
ALONE = WorkerPool(None, 1)
"""The pool of this process alone."""


@dataclass(frozen=True)
class Pass:
    """One pass over a cloud, or over the part of it that gets new points."""

    new: int
    """Number of new points."""
    fixed: int
    """Number of points, at the beginning of the cloud, that are fixed. The others are candidates."""
    rate: int
    """Candidates for each point."""


@threads(1)
def densify(
    points: Float[np.ndarray, "n 3"],
    count: int,
    source: Candidates,
    *,
    touches: Sequence[CloudArray] = (),
    normals: Float[np.ndarray, "n 3"] | None = None,
    keep: bool = True,
    core: int | None = None,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Float[np.ndarray, "new 3"]:
    """Generate the points that complete a cloud to `count` points.

    The cloud grows in passes, each by at most `GROWTH` or the rate of the source. Those before the last make it even;
    their points are candidates of the last pass, as those of the source are.

    In a pass, patches are processed independently. Among the candidates near its core, each patch chooses those that
    fill the gaps best. A core gets new points in proportion to its own number of points, so that relative densities are
    preserved.
    Touched points in regions without cloud points are subsampled to the cloud's density and added to the cloud.

    Args:
        points: the cloud, (n 3), in any frame and unit; finite.
        count: number of points of the result: old and new ones if `keep`, otherwise new ones alone.
        source: generates the candidates.
        touches: touched points, one array for each touch, in the frame and unit of `points`.
        normals: unit normals of the points, of either sign; 0 where there is none. Candidates off the tangent
            planes of all points around them are left out, so that none lie between the two sheets of a thin plate.
        keep: whether the old points are part of the result.
        core: number of points, at the beginning of `points`, that get new points. The others are their neighbourhood,
            and are not counted in `count`. Touched points in regions without cloud points are then not added: the
            caller must have put them into the cloud.
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
    if len(cloud) < FEWEST:
        raise UserError(f"the cloud has {len(cloud)} points: at least {FEWEST} are needed")
    check_cloud(cloud, extent=True)
    n = len(cloud) if core is None else core
    new = count - n if keep else count
    if new < 0:
        raise UserError(
            f"{count} points are fewer than the {n} of the cloud: ask for more, or don't keep the old ones (--replace)"
        )
    parts: list[CloudArray] = []
    touched = unseen(cloud, touches) if core is None else np.zeros((0, 3))
    if len(touched):
        _warn_of_unseen(cloud, touched, new)
        parts = [touched[:new]]
        cloud, n, new = np.concatenate([cloud, touched]), n + len(touched), new - len(parts[0])
    if normals is None:
        normals = np.zeros((len(cloud), 3))
    one_pass = functools.partial(_one_pass, source=source, touches=touches, pool=pool, advance=advance)
    start, growth = len(cloud), (n + new if keep else new) / n
    sides = [np.arange(n), np.arange(n, start)]
    firsts = [len(side) for side in sides]
    count = _passes(growth, source, keep)
    rate = RATE if source.any_rate else source.rate
    for number in range(1, count):
        steps = [
            round(first * growth ** (number / count)) - len(side) for first, side in zip(firsts, sides, strict=True)
        ]
        added = [
            one_pass(cloud, normals, Pass(step, len(cloud), rate), side)
            for step, side in zip(steps, sides, strict=True)
            if len(side)
        ]
        ends = len(cloud) + np.cumsum(steps)
        sides = [np.r_[side, end - step : end] for side, end, step in zip(sides, ends, steps, strict=True)]
        cloud = np.concatenate([cloud, *added])
    rate = LAST_RATE if source.any_rate else source.rate
    parts.append(one_pass(cloud, normals, Pass(new, start if keep else 0, rate), sides[0]))
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def _passes(growth: float, source: Candidates, keep: bool) -> int:
    """Return the number of passes: the fewest with which none exceeds the growth that suits the source."""
    most = GROWTH if source.any_rate else source.rate + keep
    return max(1, math.ceil(math.log(growth) / math.log(most) - 1e-9))


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
    normals: CloudArray,
    plan: Pass,
    within: Int[np.ndarray, " m"],
    source: Candidates,
    touches: Sequence[CloudArray],
    pool: WorkerPool,
    advance: Callable[[int, int], None],
) -> CloudArray:
    """Return the new points of the rows `within`."""
    done = at = 0
    added = np.zeros((plan.new, 3))
    cores: deque[int] = deque()
    for filled in pool.map(
        functools.partial(fill, source), _tasks(cloud, normals, plan, within, source, touches, cores)
    ):
        added[at : at + len(filled)] = filled
        at += len(filled)
        done += cores.popleft()
        advance(done, len(within))
    return added


def _tasks(
    cloud: CloudArray,
    normals: CloudArray,
    plan: Pass,
    within: Int[np.ndarray, " m"],
    source: Candidates,
    touches: Sequence[CloudArray],
    cores: deque[int],
) -> Iterator[Task]:
    before = 0
    for patch in patches(cloud, source.size, source.size // 2, within):
        points = cloud[patch.rows]
        share = (before + patch.core) * plan.new // len(within) - before * plan.new // len(within)
        before += patch.core
        cores.append(patch.core)
        nearby = list(touches) if patch.core == len(cloud) else _touches_within(points, touches)
        around = np.zeros((len(points), 3))
        known = patch.rows < len(normals)
        around[known] = normals[patch.rows[known]]
        fixed = patch.rows < plan.fixed
        yield Task(points, patch.core, fixed, around, nearby, share, plan.rate)


def _touches_within(points: CloudArray, touches: Sequence[CloudArray]) -> list[CloudArray]:
    """Return the touched points within the sphere around a patch, for each touch that has any."""
    centre = points.mean(0)
    radius = np.linalg.norm(points - centre, axis=1).max()
    inside = [touch[np.linalg.norm(touch - centre, axis=1) <= radius] for touch in touches]
    return [touch for touch in inside if len(touch)]
