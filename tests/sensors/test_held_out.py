"""Measurement of a ball whose radius, depth and place are known."""

from dataclasses import replace

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors import PressImage
from pcsr.sensors.held_out import measured
from pcsr.sensors.presses import CUT_OFF, press_of
from tests.sensors import domed
from tests.sensors.synthetic import PITCH, background, ball, calibrated, photo


def press(depth=0.7, centre=(70.0, 50.0), diameter=6.0, taken_as=None):
    image = PressImage("a", photo(ball(depth, centre, diameter), 9), taken_as or diameter)
    return press_of(image, background(), PITCH)


@pytest.mark.parametrize(
    ("diameter", "depth", "centre"), [(6.0, 0.5, (70.0, 50.0)), (6.0, 0.9, (110.0, 75.0)), (9.0, 0.7, (60.0, 60.0))]
)
def test_a_good_calibration_measures_what_is_true(diameter, depth, centre):
    found = measured(calibrated(), press(depth, centre, diameter))
    assert (found.name, found.diameter) == ("a", diameter)
    assert found.radius_ratio == pytest.approx(1, abs=0.05)
    assert found.shape < 0.006
    assert found.shape <= found.ball < 0.01
    assert found.cap_ratio == pytest.approx(1, abs=0.05)
    assert found.area_ratio == pytest.approx(1, abs=0.25)
    assert found.depth == pytest.approx(depth, rel=0.05)


def test_a_scale_of_the_slopes_is_an_error_of_the_cap_and_the_radius():
    steeper = replace(calibrated(), coefficients=1.15 * calibrated().coefficients)
    true, found = measured(calibrated(), press()), measured(steeper, press())
    assert found.cap_ratio / true.cap_ratio == pytest.approx(1.15, abs=0.06)
    assert found.radius_ratio < 0.93
    assert found.ball > 2 * true.ball


def test_the_ball_is_compared_with_the_diameter_that_is_stated():
    found = measured(calibrated(), press(0.9, taken_as=7.0))
    assert found.radius_ratio == pytest.approx(6 / 7, abs=0.05)
    assert found.ball > 2 * found.shape


def test_the_dome_is_no_error():
    for image in domed.presses(3):
        found = measured(domed.calibrated(domed.GEL), press_of(image, domed.background(), PITCH))
        assert found.radius_ratio == pytest.approx(1, abs=0.03)
        assert found.ball < 0.01


def test_a_ball_that_is_not_found_or_not_whole_is_refused():
    wild = replace(calibrated(), coefficients=np.full_like(calibrated().coefficients, 50.0))
    with pytest.raises(UserError, match="the calibration finds no ball in it"):
        measured(wild, press())
    with pytest.raises(UserError, match=CUT_OFF):
        measured(calibrated(), press(0.9, (9.0, 60.0)))
