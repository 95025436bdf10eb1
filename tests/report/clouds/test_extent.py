"""Extent of clouds: most of their values, and one cube for all that are in one frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.report.clouds.extent import cubes, ends

BALL = np.random.default_rng(0).normal(size=(400, 3))
BALL /= np.linalg.norm(BALL, axis=1, keepdims=True)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=50))
def test_ends_are_the_lowest_and_the_highest_but_for_few_that_are_far_out(values):
    (low,), (high,) = ends(np.array(values)[:, None])
    assert {low, high} <= set(values)
    outside = [value for value in values if not low <= value <= high]
    assert len(outside) <= max(1, len(values) / 25)
    if outside:
        assert np.ptp(values) > 4.99 * (high - low)
    else:
        assert (low, high) == (min(values), max(values))


@pytest.mark.parametrize("stray", [(1e10, 0, 0), (0, -1e10, 1e10), (1e300, 1e300, 1e300), (0, 0, 30)])
def test_a_stray_does_not_set_the_ends(stray):
    low, high = ends(np.vstack([BALL, [stray]]))
    np.testing.assert_array_equal(low, BALL.min(0))
    np.testing.assert_array_equal(high, BALL.max(0))


@pytest.mark.parametrize("count", [10, 40, 60])
def test_a_stray_of_a_small_cloud_does_not_set_the_ends_either(count):
    few = np.random.default_rng(count).uniform(size=(count, 3))
    _, high = ends(np.vstack([few, [[1e10, 0.5, 0.5]]]))
    assert high[0] == few[:, 0].max()


def test_points_that_are_far_but_not_lost_do():
    high = ends(np.vstack([BALL, [[5.0, 0, 0]]]))[1]
    assert high[0] == 5


def test_a_flat_cloud_with_a_mast_is_shown_whole():
    plan = np.random.default_rng(0).uniform(0, 10, (1000, 3)) * (1, 1, 0)
    mast = np.array([[5, 5, z] for z in range(1, 9)], float)
    high = ends(np.vstack([plan, mast]))[1]
    assert high[2] == 8


def test_no_values_have_ends_too():
    low, high = ends(np.zeros((0, 1)))
    assert low < high


def test_clouds_of_one_frame_share_a_cube():
    first, second = cubes([BALL, 2 * BALL + 1])
    assert first is second
    assert first.holds(BALL).all()
    assert first.holds(2 * BALL + 1).all()
    assert not first.holds(np.array([[9.0, 0, 0]])).any()
    assert np.abs(first.scaled(2 * BALL + 1)).max() <= 1
    assert np.abs(np.vstack([first.scaled(BALL), first.scaled(2 * BALL + 1)])).max() > 0.9


@pytest.mark.parametrize("other", [1000 * BALL, BALL + 1e6, BALL * 1e-3])
def test_clouds_of_other_frames_have_cubes_of_their_own(other):
    first, second = cubes([BALL, other])
    for cube, cloud in ((first, BALL), (second, other)):
        assert cube.holds(cloud).all()
        assert np.abs(cube.scaled(cloud)).max() > 0.9


@pytest.mark.parametrize("cloud", [np.zeros((1, 3)), np.full((5, 3), 7e5)])
def test_a_cloud_of_one_place_has_a_cube(cloud):
    (cube,) = cubes([cloud])
    assert cube.half > 0
    assert np.abs(cube.scaled(cloud)).max() < 1e-6
