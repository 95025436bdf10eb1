"""Coarse colours of backgrounds, and the mistakes that they show."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors.background import GRID, check_not_swapped, check_orientation, coarse, difference
from pcsr.sensors.colour import colour_change
from tests.sensors.synthetic import background, ball, calibrated, photo

COLOURED = (background() * np.linspace([0.6, 0.8, 1.0], [1.2, 1.0, 0.8], 160)).clip(0, 255).astype(np.uint8)
COLOURED = (COLOURED * np.linspace(0.7, 1.0, 120)[:, None, None]).astype(np.uint8)
TOUCHED = (COLOURED * (photo(ball()) / background())).clip(0, 255).astype(np.uint8)
"""A touch of a sensor whose colours differ from side to side, as those of real sensors do."""


@pytest.mark.parametrize("size", [(6, 8), (13, 9), (50, 71), (240, 320)])
def test_coarse_colours_are_means_of_parts_of_equal_size(size):
    image = np.random.default_rng(0).integers(0, 256, (*size, 3)).astype(np.uint8)
    parts = [np.array_split(rows, GRID[1], axis=1) for rows in np.array_split(image, GRID[0])]
    means = np.array([[part.mean((0, 1)) for part in row] for row in parts])
    np.testing.assert_allclose(coarse(image), means, atol=0.0501)


def test_a_difference_is_a_share_of_the_mean():
    grid = coarse(COLOURED)
    assert difference(grid, grid) == 0
    assert difference(1.1 * grid, grid) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        (TOUCHED[..., ::-1], "red and blue were swapped"),
        (TOUCHED[::-1], "it were upside down"),
        (TOUCHED[:, ::-1], "it were mirrored"),
        (TOUCHED[::-1, ::-1], "it were turned by half a turn"),
    ],
)
def test_an_image_that_is_turned_or_has_swapped_colours_is_refused(spoilt, said):
    colour_change(TOUCHED, COLOURED)
    with pytest.raises(UserError, match=f"^it differs from its background as if .*{said}: take both in the same way"):
        colour_change(np.ascontiguousarray(spoilt), COLOURED)


def test_light_that_drifts_and_another_sensor_are_no_matter_of_orientation():
    grid = coarse(COLOURED)
    check_orientation(1.3 * grid, grid, "it", "the other")
    check_orientation(np.random.default_rng(0).uniform(0, 255, grid.shape), grid, "it", "the other")


def test_a_background_with_a_touch_is_refused():
    rest, touch = background(), photo(ball())
    calibrated().read(touch, rest)
    for image in (rest, background(1)):
        with pytest.raises(UserError, match="its background shows a touch or is of another sensor, or the two"):
            calibrated().read(image, touch)
    drifted = (background(2) * 1.05).astype(np.uint8)
    calibrated().read((touch * 1.05).astype(np.uint8), drifted)
    check_not_swapped(coarse(drifted), coarse(drifted), calibrated().background)
