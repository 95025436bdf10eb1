"""Extent of clouds: the ends of most of their values, and the cube that a view shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64

SHARE = 0.02
"""Share of the values beyond each end of the core."""
FAR = 10.0
"""Ends of all values that are further apart than this many times the core's are left to a few strays."""
APART = 20.0
"""Clouds are in one frame if the cube around all is at most this many times as large as that around each."""


def ends(values: Float[np.ndarray, "n k"]) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]]:
    """Return the lowest and highest values of each column, or without values those of 0 and 1.

    If a few values lie so far out that the others would be drawn as one dot, these few are left out.
    """
    if not len(values):
        return np.zeros(values.shape[1]), np.ones(values.shape[1])
    low, high = values.min(0).astype(np.float64), values.max(0).astype(np.float64)
    # Rounded inwards, not interpolated: otherwise a small cloud's only stray would set the end of its core.
    core_low = np.quantile(values, SHARE, axis=0, method="higher").astype(np.float64)
    core_high = np.quantile(values, 1 - SHARE, axis=0, method="lower").astype(np.float64)
    core = float((core_high - core_low).max())
    if core > 0 and float((high - low).max()) > FAR * core:
        near = ((values >= core_low - core / 2) & (values <= core_high + core / 2)).all(1)
        if np.count_nonzero(~near) <= max(1, 2 * SHARE * values.size):
            low, high = values[near].min(0).astype(np.float64), values[near].max(0).astype(np.float64)
    return low, high


@dataclass(frozen=True)
class Cube:
    """Cube that a view shows, in the frame and unit of the clouds."""

    middle: Float64[np.ndarray, "3"]
    half: float
    """Half of its side."""

    @classmethod
    def around(cls, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> "Cube":
        """Return the cube around a box, with a margin of a twentieth."""
        middle = low + (high - low) / 2
        return cls(np.asarray(middle, np.float64), float((high - low).max()) / 2 * 1.05 or 1.0)

    def holds(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Return which points are inside."""
        inside: Bool[np.ndarray, " n"] = (np.abs(points - self.middle) <= self.half).all(1)
        return inside

    def scaled(self, points: Float[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        """Return coordinates from -1 to 1 within the cube."""
        return np.asarray((points - self.middle) / self.half, np.float64)


def cubes(clouds: Sequence[Float[np.ndarray, "_ 3"]]) -> list[Cube]:
    """Return the cube of each cloud's view: the same for all if they are in one frame, else one around each."""
    boxes = [ends(points) for points in clouds]
    own = [Cube.around(low, high) for low, high in boxes]
    common = Cube.around(np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0))
    return [common] * len(own) if common.half <= APART * min(cube.half for cube in own) else own
