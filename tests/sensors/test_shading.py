"""Synthetic indentations and images have the geometry that they claim."""

import numpy as np
import pytest

from pcsr.sensors import ball_indentation, shaded
from pcsr.sensors.contact import CONTACT_SHARE, in_contact
from pcsr.sensors.shading import AZIMUTHS, BRIGHT, NOISE

SIZE, PITCH = (90, 120), 0.15


@pytest.mark.parametrize(("diameter", "depth"), [(6.0, 0.7), (4.0, 0.3), (9.5, 1.2)])
def test_a_ball_is_a_sphere_within_the_contact_and_the_gel_sinks_in_around_it(diameter, depth):
    centre = (60.0, 45.0)
    found = ball_indentation(SIZE, PITCH, diameter, depth, centre)
    assert found.max() == found[45, 60] == pytest.approx(depth)
    contact = in_contact(found)
    rows, columns = np.nonzero(contact)
    points = np.column_stack([columns - 60, rows - 45]) * PITCH
    from_centre = np.hypot(np.linalg.norm(points, axis=1), found[contact] - depth + diameter / 2)
    np.testing.assert_allclose(from_centre, diameter / 2, atol=1e-9)
    assert found[contact].min() == pytest.approx(CONTACT_SHARE * depth, abs=0.08 * depth)
    assert (found > 0).all()
    along = found[45, 60:]
    assert (np.diff(along) < 0).all()
    # The slope changes at the rim, but not by a jump.
    assert np.abs(np.diff(along, 2)).max() < 3 * np.abs(np.diff(along)).max() * PITCH


def test_an_untouched_gel_is_brightest_towards_each_light():
    image = shaded(np.zeros(SIZE), PITCH).astype(float)
    assert image[44:46, 59:61].mean((0, 1)) == pytest.approx([BRIGHT] * 3, abs=1)
    for colour, azimuth in enumerate(AZIMUTHS):
        y, x = np.unravel_index(np.argmax(image[..., colour]), SIZE)
        assert (x - 59.5) * np.cos(azimuth) - (y - 44.5) * np.sin(azimuth) > 0


def test_a_slope_that_faces_a_light_is_brighter():
    rest = shaded(np.zeros(SIZE), PITCH).astype(float)
    x, y = np.meshgrid(np.arange(SIZE[1]), np.arange(SIZE[0]))
    for colour, azimuth in enumerate(AZIMUTHS):
        uphill = 0.1 * PITCH * (x * np.cos(azimuth) - y * np.sin(azimuth))
        change = shaded(uphill, PITCH) - rest
        assert np.argmax(change.mean((0, 1))) == colour
        assert change[..., colour].min() > 0


def test_noise_is_that_of_its_source():
    flat = np.zeros(SIZE)
    one, same, other = (shaded(flat, PITCH, np.random.default_rng(seed)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
    assert np.std(one.astype(float) - shaded(flat, PITCH)) == pytest.approx(NOISE, rel=0.1)


def test_levels_are_clipped_instead_of_wrapped():
    steep = np.cumsum(np.full(SIZE, 40 * PITCH), axis=1)
    image = shaded(steep, PITCH)
    assert image.dtype == np.uint8
    assert (image[..., 1] == 0).mean() > 0.9
