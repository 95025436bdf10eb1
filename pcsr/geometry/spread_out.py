"""Farthest point sampling from existing points, with a quota for each cell of a patch."""

import math
from bisect import bisect_left, bisect_right

import numpy as np
from jaxtyping import Float, Int

SLACK = 1.0001
"""Factor on the width of the slab in which `spread_out` updates distances; it covers rounding errors."""


def spread_out(
    candidates: Float[np.ndarray, "c 3"],
    distance: Float[np.ndarray, " c"] | None,
    cell: Int[np.ndarray, " c"],
    quotas: Int[np.ndarray, " k"],
    lengths: Float[np.ndarray, " c"] | None = None,
) -> Int[np.ndarray, " chosen"]:
    """Choose candidates by farthest point sampling from existing points, until each cell of a patch has its quota.

    Candidates of neighbouring patches compete but do not count; otherwise points pile up at the borders of patches. Of
    equally far candidates the first along x is chosen.

    No candidate is farther from the chosen points than the one that is chosen next. Choosing it thus changes
    no distance of candidates that differ from it by more than that along x, and only the slab in between is updated.

    Args:
        candidates: (c 3), in any frame; fastest where they extend farthest along x. Differences are computed in single
            precision.
        distance: of each candidate to the nearest existing point, (c). None: there are no points, and the candidate
            farthest from the centre is chosen first.
        cell: index of the cell that a candidate belongs to, (c); -1 for one of a neighbouring patch.
        quotas: number of candidates to choose in each cell, (k).
        lengths: unit of each candidate's distances, (c), positive; 1 by default.

    Returns:
        Indices of the chosen candidates: as many of each cell as its quota, or all if there are fewer.
    """
    left = np.minimum(quotas, np.bincount(cell[cell >= 0], minlength=len(quotas))).tolist()
    missing = sum(left)
    if missing == 0:
        return np.zeros(0, np.int64)
    along = np.argsort(candidates[:, 0], kind="stable")
    sorted_ones = candidates[along]
    axes = np.ascontiguousarray((sorted_ones - sorted_ones.mean(0)).T, np.float32)
    x, cells = axes[0].tolist(), cell[along]
    cell_of = cells.tolist()
    longest = 1.0 if lengths is None else float(lengths.max())
    inverse = None if lengths is None else (lengths[along] ** -2).astype(np.float32)
    closed = np.append(np.equal(left, 0), False)[cells]  # -1, the cell of others, is the last: never closed
    if distance is None:
        squared = np.full(len(along), np.inf, np.float32)
        last = int(np.where(closed, -1, np.square(axes).sum(0)).argmax())
    else:
        squared = np.square(distance[along]).astype(np.float32)
        if inverse is not None:
            squared *= inverse
        last = int(np.where(closed, -1, squared).argmax())
    squared[closed] = -1
    chosen: list[int] = []
    while True:
        own = cell_of[last]
        if own >= 0:
            chosen.append(last)
            left[own] -= 1
            if len(chosen) == missing:
                return along[chosen]
        reach = SLACK * longest * math.sqrt(squared[last])
        slab = slice(bisect_left(x, x[last] - reach), bisect_right(x, x[last] + reach))
        away = axes[:, slab] - axes[:, last, None]
        away *= away
        away = away[0] + away[1] + away[2]
        if inverse is not None:
            away *= inverse[slab]
        np.minimum(squared[slab], away, out=squared[slab])
        squared[last] = -1  # not chosen again, even if all other candidates coincide with chosen ones
        if own >= 0 and left[own] == 0:
            squared[cells == own] = -1
        last = int(squared.argmax())
