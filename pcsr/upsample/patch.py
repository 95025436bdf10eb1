"""New points of one patch: candidates are generated, those off the surface are rejected, and the gaps are filled."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.frames import OwnFrame
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.candidates import Candidates
from pcsr.upsample.gaps import between, spacing, strays, within_reach
from pcsr.upsample.noise import Quadrics
from pcsr.upsample.rejection import few_each, loneliness, on_planes
from pcsr.upsample.selection import pattern, spread_out
from pcsr.upsample.wires import chords, on_wires


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
    rate: int
    """Candidates for each point."""


@threads(1)  # a Dask worker sets its own number of threads
def fill(source: Candidates, task: Task) -> CloudArray:
    """Generate the new points of a patch's core, in the patch's own frame."""
    if task.count == 0:
        return np.zeros((0, 3))
    frame = OwnFrame.of(task.points)
    points = frame.normalize(task.points)
    order = np.concatenate([_sorted(points[: task.core]), task.core + _sorted(points[task.core :])])
    points, fixed, normals = points[order], task.fixed[order], task.normals[order] @ frame.axes
    unit = spacing(points)

    candidates = source(points, [frame.normalize(touch) for touch in task.touches], task.rate)
    wire = on_wires(points)
    close, _, nearest = within_reach(candidates, points, unit)
    close &= ~wire[nearest]
    along = chords(points, wire)
    also, _, of = within_reach(along, points, unit)
    candidates = np.concatenate([along[also], candidates[close]])
    nearest = np.concatenate([of[also], nearest[close]])
    kept = _kept(candidates, nearest, points, unit, normals, task)
    candidates = np.concatenate([points[~fixed], candidates[kept]])
    nearest = np.concatenate([np.flatnonzero(~fixed), nearest[kept]])

    distance = cKDTree(points[fixed]).query(candidates)[0] if fixed.any() else None
    chosen = candidates[
        spread_out(candidates, distance, nearest < task.core, task.count, pattern(points, unit)[nearest])
    ]
    if (unit > 0).all():
        chosen = Quadrics.fit(points, unit).displaced(chosen)
    missing = between(points, task.core, task.count - len(chosen))
    return frame.denormalize(np.concatenate([chosen, missing]))


def _kept(
    candidates: CloudArray,
    nearest: Int[np.ndarray, " c"],
    points: CloudArray,
    unit: Float[np.ndarray, " n"],
    normals: Float[np.ndarray, "n 3"],
    task: Task,
) -> Bool[np.ndarray, " c"]:
    """Return which candidates are not rejected."""
    if len(candidates) == 0:
        return np.zeros(0, bool)
    kept = np.ones(len(candidates), bool)
    capped, known = strays(points), normals.any(1)
    if capped.any():
        lonely = loneliness(candidates, unit[nearest])
        kept = few_each(nearest, capped, max(1, task.count // (2 * task.core)), lonely)
    if known.sum() > 1:
        kept &= on_planes(candidates, points[known], normals[known], spacing(points[known]))
    return kept


def _sorted(points: CloudArray) -> Int[np.ndarray, " n"]:
    """Return the lexicographic order of points."""
    return np.lexsort(points.T)
