"""New points of one patch: candidates are generated, those off the surface are rejected, and the gaps are filled."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.frames import OwnFrame
from pcsr.geometry.patches import cells
from pcsr.geometry.spread_out import spread_out
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.candidates import Candidates, Generated
from pcsr.upsample.gaps import between, spacing, strays, touched_ones, within_reach
from pcsr.upsample.neighbours import Neighbours
from pcsr.upsample.noise import Quadrics
from pcsr.upsample.rejection import few_each, isolation, on_planes
from pcsr.upsample.selection import caution, pattern
from pcsr.upsample.wires import chords, on_wires

CELL = 64
"""Largest number of points in a cell of a core. Each cell gets its share of the new points, as each core does."""
BORDER = 1.5
"""Candidates at points of the margin compete if these are no more than `BORDER` spacings from the core."""


@dataclass(frozen=True)
class Task:
    """One patch, and what is asked of it."""

    points: CloudArray
    """The core, then the margin; (n 3)."""
    core: int
    """Number of points of the core."""
    fixed: Bool[np.ndarray, " n"]
    """Which points are part of the result, or were in the cloud before; the others are candidates."""
    normals: Float[np.ndarray, "n 3"]
    """Unit normals; 0 where there is none."""
    touches: list[CloudArray]
    """Touched points near the patch."""
    count: int
    """Number of new points of the core."""
    weights: Float[np.ndarray, " core"]
    """Weights of the core's points in the shares of its cells."""
    rate: int
    """Candidates for each point."""


@threads(1)  # a Dask worker sets its own number of threads
def fill(source: Candidates, task: Task) -> Generated:
    """Generate the new points of a patch's core, in the patch's own frame, and return them in that of the task."""
    if task.count == 0:
        return Generated.of(np.zeros((0, 3)))
    frame = OwnFrame.of(task.points)
    points = frame.normalize(task.points)
    order = np.concatenate([_sorted(points[: task.core]), task.core + _sorted(points[task.core :])])
    points, fixed, normals = points[order], task.fixed[order], task.normals[order] @ frame.axes
    touches = [frame.normalize(touch) for touch in task.touches]
    cloud = Neighbours.of(points)
    unit = spacing(cloud)

    wire = on_wires(cloud)
    along = chords(points, wire)
    generated = source(points, touches, task.rate)
    candidates = np.concatenate([along, generated.points])
    errors = np.concatenate([np.zeros(len(along)), generated.errors])
    touched = touched_ones(candidates, touches)
    kept, distance, nearest = within_reach(candidates, cloud, unit)
    kept[len(along) :] &= (touched | ~wire[nearest])[len(along) :]
    competing = _competing(points, task.core, unit)
    kept &= competing[nearest]
    candidates, errors, touched, distance, nearest = (
        each[kept] for each in (candidates, errors, touched, distance, nearest)
    )
    kept = touched | _kept(candidates, nearest, touched, cloud, unit, normals, task)

    free = ~fixed & competing & (wire if source.corrects_points else True)
    candidates = np.concatenate([points[free], candidates[kept]])
    errors = np.concatenate([np.zeros(free.sum()), errors[kept]])
    touched = np.concatenate([touched_ones(points[free], touches), touched[kept]])
    nearest = np.concatenate([np.flatnonzero(free), nearest[kept]])
    away = distance[kept] if fixed.all() else cKDTree(points[fixed]).query(candidates)[0] if fixed.any() else None
    lengths = pattern(cloud, unit)[nearest] * caution(errors, nearest, unit)
    cell, quotas = _quotas(points[: task.core], task.weights[order[: task.core]], task.count)
    of_cell = np.append(cell, -1)[np.minimum(nearest, task.core)]
    chosen = spread_out(candidates, away, of_cell, quotas, lengths)
    new = candidates[chosen]
    if (unit > 0).all():
        predicted = ~touched[chosen]
        new[predicted] = Quadrics.fit(cloud, unit).displaced(new[predicted])
    rest = between(cloud, task.core, task.count - len(new))
    predicted_errors = np.concatenate([errors[chosen], np.zeros(len(rest))])
    return Generated(frame.denormalize(np.concatenate([new, rest])), frame.radius * predicted_errors)


def _quotas(
    core: CloudArray, weights: Float[np.ndarray, " n"], count: int
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " k"]]:
    """Divide a core into cells, and return the cell of each point and the number of new points of each cell."""
    cell = np.zeros(len(core), np.int64)
    sums = []
    for number, rows in enumerate(cells(core, CELL)):
        cell[rows] = number
        sums.append(weights[rows].sum())
    ends = np.round(np.cumsum(sums) / sum(sums) * count).astype(np.int64)
    return cell, np.diff(ends, prepend=0)


def _competing(points: CloudArray, core: int, unit: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return the points whose candidates compete: those of the core, and those next to it."""
    competing = np.ones(len(points), bool)
    if core < len(points):
        competing[core:] = cKDTree(points[:core]).query(points[core:])[0] <= BORDER * unit[core:]
    return competing


def _kept(
    candidates: CloudArray,
    nearest: Int[np.ndarray, " c"],
    touched: Bool[np.ndarray, " c"],
    cloud: Neighbours,
    unit: Float[np.ndarray, " n"],
    normals: Float[np.ndarray, "n 3"],
    task: Task,
) -> Bool[np.ndarray, " c"]:
    """Return which predicted candidates are not rejected."""
    kept = np.ones(len(candidates), bool)
    capped = np.flatnonzero(strays(cloud)[nearest] & ~touched)
    if len(capped):
        isolated = isolation(candidates, capped, unit[nearest[capped]])
        kept[capped] = few_each(nearest[capped], max(1, task.count // (2 * task.core)), isolated)
    known = normals.any(1)
    if len(candidates) and known.sum() > 1:
        with_normals = cloud.points[known]
        kept &= on_planes(candidates, with_normals, normals[known], spacing(with_normals))
    return kept


def _sorted(points: CloudArray) -> Int[np.ndarray, " n"]:
    """Return the lexicographic order of points."""
    return np.lexsort(points.T)
