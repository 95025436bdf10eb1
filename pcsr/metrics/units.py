"""Comparison of the sizes of clouds, which differ by a round factor if their units do."""

import warnings

import numpy as np
from jaxtyping import Float

from pcsr.errors import PcsrWarning

MOST_RATIO = 3.0
"""Largest ratio of the sizes of two clouds that are in the same unit. A metre has 3.28 feet."""
USUAL = (10.0, 25.4, 100.0, 304.8, 1000.0, 1e6)
"""Ratios of usual units: millimetres, centimetres, inches, feet, metres and micrometres."""
CLOSE = 0.15
"""Relative deviation from a usual ratio within which that ratio is shown."""


def warn_of_units(
    points: Float[np.ndarray, "n 3"],
    name: str,
    others: Float[np.ndarray, "m 3"],
    other_name: str,
    *,
    remedy: str = "convert one",
) -> None:
    """Warn if one cloud is several times as large as another that shows the same object.

    Args:
        points: a cloud.
        name: its name in the warning.
        others: another cloud, or the vertices of a mesh.
        other_name: its name in the warning.
        remedy: what to do if the units differ.

    Warns:
        PcsrWarning: the sizes differ by more than `MOST_RATIO`.
    """
    sizes = {name: _size(points), other_name: _size(others)}
    (smaller, small), (larger, large) = sorted(sizes.items(), key=lambda one: one[1])
    if 0 < small * MOST_RATIO < large:
        ratio = large / small
        shown = next((one for one in USUAL if abs(ratio / one - 1) <= CLOSE), ratio)
        warnings.warn(
            f"{larger} is {_shown(shown)} times as large as {smaller}: if their units differ, {remedy}",
            PcsrWarning,
            stacklevel=3,
        )


def _size(points: Float[np.ndarray, "n 3"]) -> float:
    """Return the median distance from the median point, which few outliers don't change; the largest if that is 0."""
    scale = float(np.abs(points).max()) or 1.0  # so that no difference overflows
    inside = points / scale
    distance = np.linalg.norm(inside - np.median(inside, axis=0), axis=1)
    return float(np.median(distance) or distance.max()) * scale


def _shown(ratio: float) -> str:
    if ratio >= 1e7:
        return f"{ratio:.1e}"
    return f"{ratio:,.0f}" if ratio >= 1000 else f"{ratio:.3g}"
