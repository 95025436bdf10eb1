"""Errors of a calibration, measured on presses of balls of known diameter that were held out of its fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

UNSEEN = 0.05
"""Share of the greatest indentation by which a touch may be reported too shallow.

The gel sinks in gently around a contact, and slopes that change its colour by less than
`pcsr.sensors.colour.UNCHANGED` count as 0. On synthetic touches by balls of 6 to 40 mm, 2 to 9 % of the indentation is
lost so. Presses of a ball cannot tell how much it is on a real gel.
"""


@dataclass(frozen=True)
class PressFigures:
    """What a calibration measures of one ball, beside what is true.

    Examples:
        >>> from pcsr.sensors import PressFigures
        >>> press = PressFigures("0.png", 6.0, 1.02, 0.005, 0.006, 0.98, 1.1, 0.6)
        >>> print(f"{press.radius_ratio * press.diameter:.2f} mm")
        6.12 mm
    """

    name: str
    diameter: float
    """Diameter of the ball in millimetres."""
    radius_ratio: float
    """Radius of the sphere that fits the measured heights best, divided by the true one."""
    shape: float
    """Root mean square distance of the measured heights from that sphere, in millimetres."""
    ball: float
    """The same from a sphere of the true radius."""
    cap_ratio: float
    """Measured height of the ball's cap above the contact's rim, divided by the true one."""
    area_ratio: float
    """Area of the contact, divided by that of the disc within the rim."""
    depth: float
    """Greatest indentation in millimetres."""


@dataclass(frozen=True)
class Figures:
    """Errors of a calibration on held-out presses.

    Examples:
        >>> from pcsr.sensors import Figures
        >>> figures = Figures(12, 0.03, 0.06, 0.006, 0.008, 0.99, 0.04, 1.1)
        >>> figures.errors(np.array([0.0, 1.0])).round(3)
        array([0.051, 0.065])
    """

    presses: int
    """Number of the held-out presses."""
    radius_median: float
    """Median of the relative error of the radius."""
    radius_90: float
    """90 % quantile of the relative error of the radius."""
    shape: float
    """Median of the root mean square distance from the fitted sphere, in millimetres."""
    ball: float
    """Median of the root mean square distance from the sphere of the true radius, in millimetres."""
    cap: float
    """Median of the cap's measured height, divided by the true one."""
    cap_spread: float
    """Root mean square of the relative error of the cap's height."""
    area: float
    """Median of the contact's area, divided by that of the disc within the rim."""

    def errors(self, indentation: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Return the expected error at each indentation, one standard deviation, in millimetres.

        It is the error of the shape, an error that grows with the indentation as that of the cap's height does, and one
        that all points share: see `UNSEEN`.
        """
        shared = UNSEEN * indentation.max(initial=0.0)
        errors: Float[np.ndarray, " m"] = np.sqrt(self.ball**2 + (self.cap_spread * indentation) ** 2 + shared**2)
        return errors


NO_FIGURES = Figures(0, *[0.0] * 7)
"""Figures of a calibration that is not measured yet."""


def summary(presses: Sequence[PressFigures]) -> Figures:
    """Summarize the errors on held-out presses."""
    radius = np.abs([press.radius_ratio - 1 for press in presses])
    return Figures(
        presses=len(presses),
        radius_median=float(np.median(radius)),
        radius_90=float(np.quantile(radius, 0.9)),
        shape=float(np.median([press.shape for press in presses])),
        ball=float(np.median([press.ball for press in presses])),
        cap=float(np.median([press.cap_ratio for press in presses])),
        cap_spread=float(np.sqrt(np.mean([(press.cap_ratio - 1) ** 2 for press in presses]))),
        area=float(np.median([press.area_ratio for press in presses])),
    )
