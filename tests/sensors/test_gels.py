"""Shapes of gels by the names of sensors."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors import GELS, Gel, gel
from pcsr.sensors.gels import check_view, check_width


def test_known_sensors_have_their_gel_and_others_a_flat_one():
    assert gel("digit") == GELS["digit"]
    assert gel("gelsight-mini").thickness == 4.25
    assert gel("my own") == Gel(None, None)


@pytest.mark.parametrize(
    ("name", "right"), [("DIGIT", "digit"), ("GelSight Mini", "gelsight-mini"), ("gelsight_mini", "gelsight-mini")]
)
def test_another_spelling_of_a_known_sensor_is_named(name, right):
    with pytest.raises(UserError, match=f"sensor '{name}' is written '{right}'"):
        gel(name)


def test_the_first_radius_is_that_along_the_longer_side_of_the_image():
    dome = Gel(dome=(50.0, 23.0))
    assert dome.radii(320, 240) == (50.0, 23.0)
    assert dome.radii(240, 320) == (23.0, 50.0)
    assert Gel().radii(320, 240) is None


def test_the_sag_is_that_of_a_parabola_and_close_to_a_sphere():
    points = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, -4.0], [3.0, -4.0]])
    np.testing.assert_allclose(Gel((30.0, 20.0)).sag(points, 4, 3), [0, 0.15, 0.4, 0.55])
    np.testing.assert_allclose(Gel((30.0, 20.0)).sag(points, 3, 4), [0, 0.225, 4 / 15, 0.225 + 4 / 15])
    ball = 30 - np.sqrt(30**2 - (points**2).sum(1))
    np.testing.assert_allclose(Gel((30.0, 30.0)).sag(points, 4, 3), ball, atol=0.004)
    assert not Gel().sag(points, 4, 3).any()


def test_an_image_shows_no_more_than_a_fingertip():
    check_width(320, 240, 0.0634)
    check_width(240, 320, 100 / 320)
    with pytest.raises(UserError, match=r"with 0\.4 the image is 96 × 128 mm, more than 100 mm: give the side of a"):
        check_width(240, 320, 0.4)
    with pytest.raises(UserError, match=r"15\.77 looks like pixels per mm: 1 / 15\.77 = 0\.0634$"):
        check_width(320, 240, 15.77)


def test_a_dome_is_not_more_curved_than_a_fingertip():
    check_view(GELS["digit"], 240, 320, 0.051)
    check_view(Gel(), 320, 240, 0.06)
    with pytest.raises(
        UserError, match=r"dome: with radii of 0\.5 and 0\.2 mm the corners of the gel lie .* mm behind"
    ):
        check_view(Gel((0.5, 0.2)), 320, 240, 0.06)
