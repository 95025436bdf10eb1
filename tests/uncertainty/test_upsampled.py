"""Errors of an upsampled cloud: touched points have those of their touches, and pass them on."""

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import ScreenedCloud
from pcsr.uncertainty.upsampled import LEFT, given_errors, upsampled_errors
from pcsr.upsample.candidates import Generated


def floor(count, seed=0, size=20.0, at=(0, 0, 0)):
    return np.column_stack([np.random.default_rng(seed).uniform(0, size, (count, 2)), np.zeros(count)]) + at


def test_touched_points_have_the_errors_of_their_touches_and_pass_them_on():
    points, touch = floor(400), floor(60, 1, 6.0, (25, 0, 0))
    errors = np.linspace(0.5, 1.5, 60)
    errors[7] = np.nan
    made = floor(200, 2)
    near = touch[:20] + np.array([1e-3, 1e-3, 0])
    new = Generated.of(np.concatenate([touch, made, near]))
    with_touch = upsampled_errors(
        points, new, touches=[touch[:30], touch[30:]], touch_errors=[errors[:30], errors[30:]]
    )
    np.testing.assert_array_equal(with_touch.new[:60], errors)
    without = upsampled_errors(points, new, touches=[touch], touch_errors=[np.full(60, np.nan)])
    np.testing.assert_array_equal(with_touch.new[60:260], without.new[60:260], "far from the touch")
    expected = np.hypot(without.new[260:], np.nan_to_num(errors[:20]))
    np.testing.assert_allclose(with_touch.new[260:], expected)
    assert len(with_touch.known) == 400


def test_without_touches_all_points_are_made():
    points, new = floor(300), Generated.of(floor(100, 1))
    assert np.isfinite(upsampled_errors(points, new).new).all()
    far = floor(50, 3, at=(0, 0, 5))
    np.testing.assert_array_equal(
        upsampled_errors(points, new, touches=[far], touch_errors=[np.ones(50)]).new, upsampled_errors(points, new).new
    )


def test_points_without_noise_have_part_of_what_was_removed():
    points, new = floor(300), Generated.of(floor(100, 1))
    found, plain = upsampled_errors(points, new, removed=0.4), upsampled_errors(points, new)
    assert (found.known == LEFT * 0.4).all()
    assert (plain.known == 0).all()
    assert np.median(found.new) > np.median(plain.new)


def test_points_that_are_not_used_have_no_error_but_copies_do():
    points = floor(20)
    every = np.concatenate([points[:3], [[np.nan, 0, 0]], points[3:], points[5:6], [[900.0, 0, 0]]])
    used = np.ones(len(every), bool)
    used[[3, -2, -1]] = False
    errors = np.arange(20.0)
    found = given_errors(ScreenedCloud(Cloud(every), used), errors)
    np.testing.assert_array_equal(found[used], errors)
    assert found[-2] == 5
    assert np.isnan(found[[3, -1]]).all()


@pytest.mark.parametrize("count", [0, 5])
def test_all_new_points_may_be_touched_ones(count):
    points, touch = floor(100), floor(40, 1, 4.0, (22, 0, 0))
    new = Generated.of(np.concatenate([touch, floor(count, 2)]))
    found = upsampled_errors(points, new, touches=[touch], touch_errors=[np.full(40, 0.3)])
    np.testing.assert_array_equal(found.new[:40], 0.3)
    assert np.isfinite(found.new).all()
