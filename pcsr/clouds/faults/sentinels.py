"""Sentinels: coordinates that software writes where it measured nothing, such as 0 0 0 and -9999."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.spatial import cKDTree

from pcsr.clouds.faults.outliers import FEWEST
from pcsr.geometry.magnitude import exponent, scaled

SPOTS = ((0.0, 0.0, 0.0), (-1.0, -1.0, -1.0), (0.0, 0.0, -1.0))
"""Points that stand for an invalid pixel."""
VALUES = (
    *(-9999.0, -99999.0, -999999.0, -32767.0, -32768.0, 32767.0, 65535.0, 65.535),
    *(sign * value for value in (1e10, 1e20, 1e30, 1e38, 3.4e38, 3.4028234663852886e38) for sign in (1, -1)),
    *(sign * 1.7976931348623157e308 for sign in (1, -1)),
)
"""Coordinates that stand for a missing measurement: of elevation models, of depth images, and the largest numbers."""
ROUNDING = 1e-6
"""Relative difference between a value and the same value in single precision."""
MANY = 10
"""A sentinel is at least this many times as frequent as the most frequent other position, times the median number of
points at a position: the corners of separate triangles are several points each, and the tip of a cone is hundreds."""
SOME = 3
"""Likewise for one of `SPOTS` that lies apart."""
MOST_SPOTS = 8
"""Largest number of positions of a cloud that are sentinels because they are frequent."""
APART = 10.0
"""A position lies apart if its nearest neighbour is this many median distances of neighbours away."""
SAMPLE = 1000
"""Positions whose neighbours give the median distance."""


def frequent_sentinels(positions: Float64[np.ndarray, "p 3"], count: Int[np.ndarray, " p"]) -> Bool[np.ndarray, " p"]:
    """Return which positions are sentinels because far more points are there than anywhere else.

    They lie apart from the other positions, or are the origin.

    Args:
        positions: finite coordinates, each once, in lexicographic order.
        count: number of points at each.
    """
    many, some = (_exceptional(count, factor) for factor in (MANY, SOME))
    if not some.any():
        return some
    known = (positions[:, None] == np.array(SPOTS)).all(axis=2)
    certain: Bool[np.ndarray, " p"] = many & known[:, 0]
    possible = np.flatnonzero((many | (some & known.any(axis=1))) & ~certain)
    points = scaled(positions, -exponent([positions]))
    others = points[~some]
    if len(possible) and len(others) > 1:
        tree = cKDTree(others)
        sample = others[:: -(-len(others) // SAMPLE)]
        spacing = float(np.median(tree.query(sample, k=[2], p=np.inf)[0]))
        certain[possible] = tree.query(points[possible], p=np.inf)[0] >= APART * spacing
    return certain


def _exceptional(count: Int[np.ndarray, " p"], factor: int) -> Bool[np.ndarray, " p"]:
    """Return the few positions that have far more points than any other: by `factor`, times the median number."""
    factor = factor * int(np.median(count))
    top = np.sort(count)[::-1][: MOST_SPOTS + 1]
    jumps = np.flatnonzero(top[:-1] >= factor * top[1:])
    fewest = top[jumps[-1]] if len(jumps) else np.inf
    exceptional: Bool[np.ndarray, " p"] = count >= fewest
    return exceptional


def sentinel_values(positions: Float64[np.ndarray, "p 3"]) -> Iterator[tuple[int, float, Bool[np.ndarray, " p"]]]:
    """Yield axis, value and positions of each of `VALUES` that lies apart from all other coordinates of its axis.

    It is farther from them than they are from one another, and than half its own size. So a cloud in millimetres may
    have points at 65535.

    Args:
        positions: finite coordinates, each once.
    """
    for axis, column in enumerate(positions.T):
        low, high = float(column.min()), float(column.max())
        with np.errstate(over="ignore"):
            found = {
                value: np.abs(column - value) <= ROUNDING * abs(value)
                for value in VALUES
                if low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high)
            }
        found = {value: there for value, there in found.items() if there.any()}
        rest = column[~np.any(list(found.values()), axis=0)] if found else column
        if not found or len(rest) < FEWEST:
            continue
        inner = np.quantile(rest, [0.05, 0.95], method="nearest")
        for value, there in found.items():
            with np.errstate(over="ignore"):
                gap = float(np.abs(rest - value).min())
            if gap > max(float(inner[1] - inner[0]), abs(value) / 2):
                yield axis, value, there
