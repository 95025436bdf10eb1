"""Upsampling of a cloud of any size to any number of points, patch by patch."""

import functools
import math
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.patches import patches
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.candidates import Candidates, Generated
from pcsr.upsample.passes import Pass, passes, weights
from pcsr.upsample.patch import Task, fill
from pcsr.upsample.unseen import unseen
from pcsr.workers import WorkerPool

FEWEST = 16
"""Smallest number of points of a cloud."""
MARGIN = 13.5
"""Number of points of a patch's margin, in square roots of that of its core: three to four rows around it."""
GAP = 2.0
"""A touched point closer to the cloud than `GAP` local spacings lies in a gap of the cloud, and needs no warning."""
ALONE = WorkerPool(None, 1)
"""The pool of this process alone."""


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
) -> Generated:
    """Generate the points that complete a cloud to `count` points.

    The cloud grows in passes, each by at most `GROWTH` or the rate of the source. Those before the last make it even;
    their points are candidates of the last pass, as those of the source are.

    In a pass, patches are processed independently. Among the candidates near its core, each patch chooses those that
    fill the gaps best. A core gets new points in proportion to its own number of points, so that relative densities are
    preserved; from the second pass on, also in proportion to its area (`passes.weights`).

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
        advance: called after each patch with the number of points processed in this pass and those before, and their
            number in all passes.

    Returns:
        The new points with their predicted errors, in the unit of the cloud. Touched points in regions without cloud
        points come first; the order of the others follows the shape of the cloud.

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
    parts: list[Generated] = []
    touched = unseen(cloud, touches) if core is None else np.zeros((0, 3))
    if len(touched):
        _warn_of_unseen(cloud, touched, new)
        parts = [Generated.of(touched[:new])]
        cloud, n, new = np.concatenate([cloud, touched]), n + len(touched), new - len(parts[0].points)
    if normals is None:
        normals = np.zeros((len(cloud), 3))
    start, plans = len(cloud), passes(n, new, source, keep)
    own, margin = np.arange(n), np.arange(n, start)
    total = sum(plan.points for plan in plans) + sum(plan.of_margin(start - n).points for plan in plans[:-1])
    one_pass = functools.partial(
        _one_pass, normals=normals, source=source, touches=touches, pool=pool, advance=_counted(advance, total)
    )
    for plan in plans[:-1]:
        added = one_pass(cloud, own, plan, fixed=len(cloud)).points
        beside = one_pass(cloud, margin, plan.of_margin(len(margin)), fixed=len(cloud)).points
        own = np.r_[own, len(cloud) + np.arange(len(added))]
        margin = np.r_[margin, len(cloud) + len(added) + np.arange(len(beside))]
        cloud = np.concatenate([cloud, added, beside])
    parts.append(one_pass(cloud, own, plans[-1], fixed=start if keep else 0))
    return Generated.joined(parts) if len(parts) > 1 else parts[0]


def _counted(advance: Callable[[int, int], None], total: int) -> Callable[[int], None]:
    """Return a function that adds a number of points to those processed, and calls `advance` with their sum."""
    done = 0

    def add(points: int) -> None:
        nonlocal done
        done += points
        advance(done, total)

    return add


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
    rows: Int[np.ndarray, " m"],
    plan: Pass,
    *,
    fixed: int,
    normals: CloudArray,
    source: Candidates,
    touches: Sequence[CloudArray],
    pool: WorkerPool,
    advance: Callable[[int], None],
) -> Generated:
    """Return the new points of the rows of a cloud. The first `fixed` points of the cloud are fixed."""
    added, errors, at = np.zeros((plan.new, 3)), np.zeros(plan.new), 0
    if len(rows) == 0:
        return Generated(added, errors)
    cores: deque[int] = deque()
    tasks = _tasks(cloud, rows, plan, fixed, normals, source, touches, cores)
    for filled in pool.map(functools.partial(fill, source), tasks):
        part = slice(at, at + len(filled.points))
        added[part], errors[part] = filled.points, filled.errors
        at = part.stop
        advance(cores.popleft())
    return Generated(added, errors)


def _tasks(
    cloud: CloudArray,
    rows: Int[np.ndarray, " m"],
    plan: Pass,
    fixed: int,
    normals: CloudArray,
    source: Candidates,
    touches: Sequence[CloudArray],
    cores: deque[int],
) -> Iterator[Task]:
    weight = weights(cloud, plan)
    total, before = weight[rows].sum(), 0.0
    for patch in patches(cloud, source.size, core_size(source.size), rows):
        points = cloud[patch.rows]
        of_core = weight[patch.rows[: patch.core]]
        after = before + of_core.sum()
        share = round(after / total * plan.new) - round(before / total * plan.new)
        before = after
        cores.append(patch.core)
        nearby = list(touches) if patch.core == len(cloud) else _touches_within(points, touches)
        around = np.zeros((len(points), 3))
        known = patch.rows < len(normals)
        around[known] = normals[patch.rows[known]]
        yield Task(points, patch.core, patch.rows < fixed, around, nearby, share, of_core, plan.rate)


def core_size(size: int) -> int:
    """Return the largest number of points in the core of a patch of `size` points."""
    root = (math.sqrt(MARGIN**2 + 4 * size) - MARGIN) / 2
    return max(size // 2, round(root**2))


def _touches_within(points: CloudArray, touches: Sequence[CloudArray]) -> list[CloudArray]:
    """Return the touched points within the sphere around a patch, for each touch that has any."""
    centre = points.mean(0)
    radius = np.linalg.norm(points - centre, axis=1).max()
    inside = [touch[np.linalg.norm(touch - centre, axis=1) <= radius] for touch in touches]
    return [touch for touch in inside if len(touch)]
