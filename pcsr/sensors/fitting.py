"""Fit of a calibration: slopes, and where in its image each ball lies.

Nothing is labelled by hand. From the middle of each changed region on, the polynomials are fitted to the slopes that
the balls have there, and then each ball is moved to where the fitted slopes say it is; both are repeated. The slopes
within a contact depend on the position of the ball's centre alone, not on how deep it is pressed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.sensors.balls import FEWEST, RIM, ball_slopes, rim_radius, voted_centre
from pcsr.sensors.polynomial import slopes
from pcsr.sensors.presses import Press

ROUNDS = 10
"""Times that the slopes and the balls' places are found in turn."""
SETTLE = 2
"""First rounds in which the contacts' radii stay as they began."""
INNER = 0.9
"""Share of the contact's radius within which slopes are fitted: its rim is blurred."""
START = 0.6
"""First radius of a contact, as a share of that of the changed region."""
RIDGES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Weights of the ridge regression among which cross-validation chooses."""
RIDGE = 1e-2
"""Weight of the ridge regression before cross-validation."""
FOLDS = 6
"""Number of parts of the presses in the cross-validation of the weight."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a ball lies in its image, in pixels.

    Examples:
        >>> from pcsr.sensors import Place
        >>> place = Place(np.array([160.0, 120.0]), rim=31.0, residual=0.05)
        >>> print(f"{np.degrees(place.residual):.1f} degrees")
        2.9 degrees
    """

    centre: Float[np.ndarray, "2"]
    """Column and row of the ball's centre."""
    rim: float
    """Radius of the contact."""
    residual: float
    """Median angle between the fitted slopes and those of the ball, in radians."""


@dataclass(frozen=True)
class Fit:
    """Fitted slopes, and the places of the balls."""

    coefficients: Float[np.ndarray, "k 2"]
    places: list[Place]


@dataclass(frozen=True)
class _Moments:
    """Moments of one press for the normal equations of the fit."""

    square: Float[np.ndarray, "k k"]
    product: Float[np.ndarray, "k 2"]
    total: float
    """Sum of the squared targets."""
    count: int


def fit(presses: Sequence[Press], sag: Float[np.ndarray, "2"]) -> Fit:
    """Fit the slopes and the places of the balls.

    Args:
        presses: at least two presses.
        sag: curvature of the untouched gel along x and y, in 1/pixel; 0 for a flat one.
    """
    places = [Place(press.centre, START * min(press.radius, press.ball), 0.0) for press in presses]
    ridge = RIDGE
    for turn in range(ROUNDS):
        moments = [_moments(press, place, sag) for press, place in zip(presses, places, strict=True)]
        if turn > SETTLE:
            ridge = _best_ridge(moments)
        coefficients = _solved(moments, ridge)
        places = [
            located(press, coefficients, place, sag, keep_rim=turn < SETTLE)
            for press, place in zip(presses, places, strict=True)
        ]
    return Fit(_solved([_moments(p, place, sag) for p, place in zip(presses, places, strict=True)], ridge), places)


def located(
    press: Press, coefficients: Float[np.ndarray, "k 2"], place: Place, sag: Float[np.ndarray, "2"], *, keep_rim: bool
) -> Place:
    """Move a ball to where fitted slopes say it is."""
    found = slopes(press.monomials, coefficients) - _rest(press, sag)
    near = np.hypot(press.columns - place.centre[0], press.rows - place.centre[1]) < INNER * place.rim
    if near.sum() < FEWEST:
        return place
    centre = voted_centre(press.columns[near], press.rows[near], found[near], press.ball)
    # A ball that leaves its region is lost: its press is refused in the end, and must not spoil the others.
    if np.hypot(*(centre - press.centre)) > press.radius:
        centre = press.centre
    rim = place.rim if keep_rim else rim_radius(press.columns, press.rows, found, centre, press.ball)
    inner, expected = _inside(press, centre, rim)
    apart = np.arctan(found[inner]) - np.arctan(expected)
    residual = float(np.median(np.linalg.norm(apart, axis=1))) if inner.any() else np.pi
    return Place(centre, rim, residual)


def _inside(press: Press, centre: Float[np.ndarray, "2"], rim: float) -> tuple[np.ndarray, Float[np.ndarray, "m 2"]]:
    """Return the mask of the pixels well within the contact, and the ball's slopes there."""
    inner = np.hypot(press.columns - centre[0], press.rows - centre[1]) < INNER * min(rim, RIM[1] * press.ball)
    return inner, ball_slopes(press.columns[inner], press.rows[inner], centre, press.ball)


def _rest(press: Press, sag: Float[np.ndarray, "2"]) -> Float[np.ndarray, "n 2"]:
    """Return the slopes of the sag of the untouched gel: those of the indentation are the ball's and these together."""
    height, width = press.change.shape[:2]
    return np.stack([(press.columns - (width - 1) / 2) * sag[0], (press.rows - (height - 1) / 2) * sag[1]], axis=-1)


def _moments(press: Press, place: Place, sag: Float[np.ndarray, "2"]) -> _Moments:
    inner, expected = _inside(press, place.centre, place.rim)
    values = press.monomials[inner]
    target = np.arctan(expected + _rest(press, sag)[inner])
    return _Moments(values.T @ values, values.T @ target, float((target**2).sum()), int(inner.sum()))


def _solved(moments: Sequence[_Moments], ridge: float) -> Float[np.ndarray, "k 2"]:
    """Solve the normal equations with each monomial scaled to a mean square of 1."""
    count = max(1, sum(one.count for one in moments))
    square, product = sum(one.square for one in moments) / count, sum(one.product for one in moments) / count
    scale = np.sqrt(np.diag(square)) + 1e-12
    scaled = square / scale[:, None] / scale + ridge * np.eye(len(scale))
    solution: Float[np.ndarray, "k 2"] = np.linalg.solve(scaled, product / scale[:, None]) / scale[:, None]
    return solution


def _best_ridge(moments: Sequence[_Moments]) -> float:
    """Choose the weight with the least error on presses left out of the fit."""
    folds = [list(range(first, len(moments), FOLDS)) for first in range(min(FOLDS, len(moments)))]

    def error(ridge: float) -> float:
        total = 0.0
        for fold in folds:
            solution = _solved([one for k, one in enumerate(moments) if k not in fold], ridge)
            for one in (moments[k] for k in fold):
                squares = np.sum(solution * (one.square @ solution)) - 2 * np.sum(solution * one.product) + one.total
                total += squares / max(1, one.count)
        return float(total)

    return min(RIDGES, key=error)
