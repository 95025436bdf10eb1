"""Readings of a calibrated sensor: their geometry, their expected errors, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors import Gel
from pcsr.sensors.background import GRID, coarse
from pcsr.sensors.calibration import slopes_of
from pcsr.sensors.colour import colour_change
from tests.sensors import domed
from tests.sensors.synthetic import PITCH, SIZE, background, ball, calibrated, photo

NOISE = np.random.default_rng(0).integers(40, 200, (*SIZE, 3)).astype(np.uint8)
TOUCHES = [(6.0, 0.5, (40.0, 40.0)), (8.0, 0.6, (80.0, 60.0)), (4.0, 0.5, (60.0, 80.0)), (10.0, 1.0, (90.0, 50.0))]


def reading(depth=0.7, centre=(80.0, 60.0), diameter=6.0, seed=0):
    true = ball(depth, centre, diameter)
    return calibrated().read(photo(true, seed), background(seed + 50)), true


@pytest.mark.parametrize(("diameter", "depth", "centre"), TOUCHES)
def test_slopes_are_the_differences_of_the_indentation(diameter, depth, centre):
    true = ball(depth, centre, diameter)
    found, touched = slopes_of(colour_change(photo(true), background()), calibrated().coefficients)
    down, right = np.gradient(true, PITCH)
    steep = np.hypot(right, down) > 0.1
    assert touched[steep].all()
    assert not found[~touched].any()
    apart = np.linalg.norm(found - np.stack([right, down], axis=-1), axis=-1)[steep]
    assert np.median(apart) < 0.03


@pytest.mark.parametrize(("diameter", "depth", "centre"), TOUCHES)
def test_points_lie_on_the_object_as_closely_as_expected_but_for_a_common_offset(diameter, depth, centre):
    found, true = reading(depth, centre, diameter)
    apart = found.points[:, 2] - true[found.contact]
    # Slopes that change the colour too little to be seen are taken as 0, so that the face lies a little too low.
    assert abs(np.median(apart)) < 0.03 * depth
    shape = np.abs(apart - np.median(apart))
    assert (shape < found.errors).mean() > 0.5
    assert (shape < 3 * found.errors).mean() > 0.95


def test_points_are_in_the_frame_of_the_sensor():
    found, _ = reading(centre=(110.0, 40.0))
    deepest = found.points[np.argmax(found.points[:, 2])]
    np.testing.assert_allclose(deepest[:2], [(110 - 79.5) * PITCH, (59.5 - 40) * PITCH], atol=2 * PITCH)
    assert len(found.points) == len(found.errors) == found.contact.sum()
    assert found.area == pytest.approx(found.contact.sum() * PITCH**2)
    assert found.area == pytest.approx(np.pi * (3**2 - (3 - 0.6 * 0.7) ** 2), rel=0.2)
    assert found.view == pytest.approx((160 * PITCH, 120 * PITCH))
    np.testing.assert_array_equal(found.points[:, 2], found.indentation[found.contact])


def test_a_drift_of_the_light_changes_nothing():
    image = photo(ball())
    np.testing.assert_allclose(
        calibrated().read(image + np.uint8(6), background()).points, calibrated().read(image, background()).points
    )


@pytest.mark.parametrize(("height", "x", "y"), [(0.5, 0.0, 0.0), (0.3, 2.0, 1.0)])
def test_a_flat_plate_on_a_domed_gel_is_flat(height, x, y):
    flatness = {}
    for gel in (domed.GEL, Gel()):
        found = domed.calibrated(gel).read(domed.touched(domed.plate(height, x, y), 5), domed.background())
        inner = np.hypot(found.points[:, 0] - x, found.points[:, 1] - y) < 2.5
        flatness[gel] = found.points[inner, 2].std()
        if gel is domed.GEL:
            assert found.points[inner, 2].mean() == pytest.approx(height, abs=0.04)
            assert found.view is None
            sunk = found.indentation[found.contact][inner].std()
            assert sunk > 4 * flatness[gel]
    assert flatness[domed.GEL] < 0.01 < 0.03 < flatness[Gel()]


def test_an_untouched_gel_is_no_contact():
    with pytest.raises(UserError, match=r"no contact: the gel is indented by 0\.0\d mm at most, less than 0\.05 mm"):
        calibrated().read(background(1), background(2))
    with pytest.raises(UserError, match="no contact"):
        calibrated().read(background(1), background(1))


def test_nothing_sinks_deeper_than_the_gel_is_thick():
    thin = replace(calibrated(), gel=Gel(thickness=0.5))
    with pytest.raises(UserError, match=r"indented by 0\.9 mm, but the gel is 0\.5 mm thick"):
        thin.read(photo(ball(0.9)), background())
    assert len(thin.read(photo(ball(0.4)), background()).points)


def test_no_gel_is_thicker_than_a_centimetre():
    steep = replace(calibrated(), mm_per_pixel=20 * PITCH)
    with pytest.raises(
        UserError, match=r"indented by \d\d\.\d mm, but such gels are 10 mm thick at most: it is torn, or"
    ):
        steep.read(photo(ball()), background())


@pytest.mark.parametrize(
    ("image", "rest", "message"),
    [
        (photo(ball())[:-1], background(), "it has 160 x 119 pixels, but the calibration of sensor 'x' is for 160 x 1"),
        (photo(ball()), background()[:, 1:], "its background has 159 x 120 pixels, but the calibration"),
        (photo(ball()), background() // 3, r"its background differs by 6\d% from that of the calibration"),
        (photo(ball()), background() // 60, "its background is black"),
        (photo(ball()) // 60, background(), "it is black"),
        (NOISE, background(), "it is of another sensor or light"),
    ],
)
def test_other_images_are_refused(image, rest, message):
    with pytest.raises(UserError, match=message):
        calibrated().read(image, rest)


def test_the_coarse_grid_has_the_mean_colours():
    image = background()
    found = coarse(image)
    assert found.shape == (*GRID, 3)
    np.testing.assert_allclose(found[1, 2], image[20:40, 40:60].mean((0, 1)), atol=0.05)
    np.testing.assert_allclose(found.mean((0, 1)), image.mean((0, 1)), atol=0.05)
    assert coarse(background()[:50, :70]).shape == found.shape
    assert SIZE[0] % GRID[0] == SIZE[1] % GRID[1] == 0
