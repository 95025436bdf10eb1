"""Comparison of the sizes of clouds, which differ by a round factor if their units do."""

import warnings

import numpy as np
from jaxtyping import Float

from pcsr.errors import PcsrWarning

SUSPICIOUS = 5.0
"""Ratio of sizes from which on two clouds are taken to be in different units: part of an object is seldom so small."""
USUAL = (10.0, 25.4, 100.0, 304.8, 1000.0, 1e6)
"""Ratios of usual units: millimetres, centimetres, inches, feet, metres and micrometres."""
CLOSE = 0.15
"""Relative deviation from a usual ratio within which that ratio is shown."""


def warn_of_units(
    points: Float[np.ndarray, "n 3"], name: str, others: Float[np.ndarray, "m 3"], other_name: str
) -> None:
    """Warn if one cloud is several times larger than another that shows the same object.

    Args:
        points: a cloud.
        name: its name in the warning.
        others: another cloud, or the vertices of a mesh.
        other_name: its name in the warning.

    Warns:
        PcsrWarning: the ratio of the sizes is `SUSPICIOUS` or more.
    """
    first, second = _size(points), _size(others)
    if not (first > 0 and second > 0):
        return
    large, small = (name, other_name) if first > second else (other_name, name)
    ratio = max(first / second, second / first)
    if ratio >= SUSPICIOUS:
        usual = [one for one in USUAL if abs(ratio / one - 1) <= CLOSE]
        warnings.warn(
            f"{large} is {_shown(usual[0] if usual else ratio)} times larger than {small}: are the units the same?",
            PcsrWarning,
            stacklevel=2,
        )


def _size(points: np.ndarray) -> float:
    """Return the median distance from the median point, which stray points do not change; the extent if that is 0."""
    middle = np.median(points, axis=0)
    with np.errstate(over="ignore"):
        typical = float(np.median(np.linalg.norm(points - middle, axis=1)))
    return typical if np.isfinite(typical) and typical > 0 else float(np.abs(points - middle).max())


def _shown(ratio: float) -> str:
    if ratio >= 1e7:
        return f"{ratio:.1e}"
    return f"{ratio:,.0f}" if ratio >= 1000 else f"{ratio:.3g}"
