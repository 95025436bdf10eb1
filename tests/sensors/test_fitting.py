"""The fit of slopes and places of balls: on presses whose balls are known, and its parts against ones written out."""

import numpy as np
import pytest

from pcsr.sensors.fitting import FOLDS, RIDGES, _best_ridge, _Moments, _solved, fit, located
from pcsr.sensors.polynomial import monomials, slopes
from pcsr.sensors.presses import press_of
from tests.sensors.synthetic import PITCH, SIZE, background, ball, presses

FLAT = np.zeros(2)


def usable(count=12, seed=0):
    return [press_of(press, background(), PITCH) for press in presses(count, seed)]


def truth(count=12, seed=0):
    """Depths and centres of `presses`."""
    rng = np.random.default_rng(seed)
    return [(rng.uniform(0.5, 0.9), (rng.uniform(30, 130), rng.uniform(30, 90))) for _ in range(count)]


def moments(count=9, monomials=5, seed=0):
    """Random regressions of one truth, with the moments of each."""
    rng = np.random.default_rng(seed)
    true = rng.normal(size=(monomials, 2))
    for number in range(count):
        values = rng.normal(size=(20 + number, monomials)) * [1, 10, 0.1, 1, 1]
        target = values @ true + rng.normal(0, 3, (len(values), 2))
        yield values, target, _Moments(values.T @ values, values.T @ target, float((target**2).sum()), len(values))


def ridge_regression(values, target, ridge):
    """Least squares with each column scaled to a mean square of 1, and rows that pull the coefficients to 0."""
    scale = np.sqrt((values**2).mean(0))
    rows = np.sqrt(ridge * len(values)) * np.eye(values.shape[1])
    design, right = np.vstack([values / scale, rows]), np.vstack([target, np.zeros((len(rows), 2))])
    return np.linalg.lstsq(design, right, rcond=None)[0] / scale[:, None]


@pytest.mark.parametrize("ridge", [1e-4, 1e-2, 1.0])
def test_the_normal_equations_solve_a_ridge_regression(ridge):
    values, targets, found = zip(*moments(), strict=True)
    expected = ridge_regression(np.vstack(values), np.vstack(targets), ridge)
    np.testing.assert_allclose(_solved(found, ridge), expected, rtol=1e-6)


def test_the_weight_is_that_of_the_least_error_on_presses_left_out():
    values, targets, found = zip(*moments(), strict=True)

    def error(ridge):
        total = 0.0
        for first in range(FOLDS):
            fold = range(first, len(values), FOLDS)
            kept = [k for k in range(len(values)) if k not in fold]
            solution = ridge_regression(
                np.vstack([values[k] for k in kept]), np.vstack([targets[k] for k in kept]), ridge
            )
            total += sum(((values[k] @ solution - targets[k]) ** 2).sum() / len(values[k]) for k in fold)
        return total

    assert _best_ridge(found) == min(RIDGES, key=error)
    assert error(RIDGES[0]) != pytest.approx(error(RIDGES[-1]), rel=1e-3)


def test_the_places_of_the_balls_are_found():
    found = fit(usable(), FLAT)
    for place, (depth, centre) in zip(found.places, truth(), strict=True):
        assert np.linalg.norm(place.centre - centre) < 0.6
        assert place.rim == pytest.approx(np.sqrt(3**2 - (3 - 0.6 * depth) ** 2) / PITCH, abs=1.5)
        assert np.degrees(place.residual) < 2


def test_the_slopes_are_those_of_presses_that_were_not_fitted():
    found = fit(usable(), FLAT)
    rows, columns = (one.ravel() for one in np.mgrid[: SIZE[0], : SIZE[1]])
    for press, (depth, centre) in zip(usable(3, seed=5), truth(3, seed=5), strict=True):
        down, right = np.gradient(ball(depth, centre), PITCH)
        inner = np.hypot(columns - centre[0], rows - centre[1]) * PITCH < 1.2
        values = monomials(press.change.reshape(-1, 3)[inner], rows[inner] * 1.0, columns[inner] * 1.0, SIZE)
        expected = np.stack([right.ravel()[inner], down.ravel()[inner]], axis=-1)
        assert np.median(np.abs(slopes(values, found.coefficients) - expected)) < 0.02


def test_a_ball_that_is_lost_stays_in_its_region():
    (press,) = usable(1)
    found = fit(usable(), FLAT)
    wild = np.full_like(found.coefficients, 50.0)
    place = located(press, wild, found.places[0], FLAT, keep_rim=True)
    np.testing.assert_allclose(place.centre, press.centre)
    assert place.residual > np.radians(30)


def test_a_contact_of_too_few_pixels_stays_where_it_is():
    (press,) = usable(1)
    found = fit(usable(), FLAT)
    tiny = type(found.places[0])(press.centre, 1.0, 0.0)
    assert located(press, found.coefficients, tiny, FLAT, keep_rim=False) is tiny
