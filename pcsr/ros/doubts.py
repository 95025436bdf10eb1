"""What is odd about the transforms of a frame around a time, though they can be used."""

from collections.abc import Collection

import numpy as np
from jaxtyping import Float64

AROUND = 0.25
"""Time before and after a query in which transforms must agree with one another, in seconds."""
JUMPS = 10.0
"""Transforms that differ this many times more from the next one than from the next but one jump back and forth."""
LEAST_JUMP = 1e-3
"""Smallest such jump in metres."""
MOST_LISTED = 5
"""Most parents that a message lists."""


def doubt(child: str, parents: Collection[str], positions: Float64[np.ndarray, "n 3"]) -> str | None:
    """Return what is odd about transforms within `AROUND` of a time; None if nothing is.

    Args:
        child: name of the frame.
        parents: parent of each transform.
        positions: translation of each, in the order of time.
    """
    if len(names := sorted(set(parents))) > 1:
        listed = ", ".join(f"'{name}'" for name in names[:MOST_LISTED])
        return f"frame '{child}' has several parents within {AROUND:g} s, {listed}: that of the nearest time is used"
    if _jumps(positions):
        return f"frame '{child}' jumps back and forth: two programs seem to publish its transforms"
    return None


def _jumps(positions: Float64[np.ndarray, "n 3"]) -> bool:
    """Return whether a frame is in turn at one of two places."""
    if len(positions) < 4 or not np.isfinite(positions).all():
        return False
    with np.errstate(over="ignore"):
        apart = [float(np.median(np.linalg.norm(positions[k:] - positions[:-k], axis=1))) for k in (1, 2)]
    return apart[0] > max(LEAST_JUMP, JUMPS * apart[1])
