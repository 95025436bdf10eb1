"""Lengths follow the density of the cloud and the predicted errors of candidates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.geometry.spread_out import spread_out
from pcsr.upsample.gaps import spacing
from pcsr.upsample.selection import CAUTION, caution, pattern


def sheet(left, right, rng):
    """A square whose two halves have so many points."""
    x = np.concatenate([rng.uniform(0, 1, left), rng.uniform(1, 2, right)])
    return np.column_stack([x, 2 * rng.uniform(0, 1, len(x)), np.zeros(len(x))])


def test_lengths_follow_the_density_and_not_its_chance():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    even = np.column_stack([x.ravel(), y.ravel(), np.zeros(400)])
    np.testing.assert_array_equal(pattern(even, spacing(even)), 1)
    chance = sheet(250, 250, rng)
    np.testing.assert_allclose(pattern(chance, spacing(chance)), 1, atol=0.1)
    uneven = sheet(400, 100, rng)
    lengths = pattern(uneven, spacing(uneven))
    dense, sparse = (np.median(lengths[(uneven[:, 0] - x) ** 2 < 0.1]) for x in (0.5, 1.5))
    assert sparse / dense == pytest.approx(2, rel=0.15)


def test_lengths_change_with_the_order_and_size_of_the_cloud_alike():
    rng = np.random.default_rng(1)
    cloud = sheet(300, 60, rng)
    order = rng.permutation(len(cloud))
    lengths = pattern(cloud, spacing(cloud))
    np.testing.assert_allclose(pattern(9 * cloud[order], spacing(9 * cloud[order])), lengths[order], rtol=1e-9)


def test_without_predicted_errors_all_candidates_are_equal():
    assert (caution(np.zeros(5), np.array([0, 0, 1, 1, 1]), np.ones(2)) == 1).all()


@given(seed=st.integers(0, 500), scale=st.floats(0.01, 100))
def test_caution_grows_with_the_error_in_spacings_and_is_one_on_average_around_each_point(seed, scale):
    rng = np.random.default_rng(seed)
    nearest, errors, unit = rng.integers(0, 6, 60), rng.uniform(0, 1, 60), rng.uniform(0.5, 2, 6)
    factors = caution(errors, nearest, unit)
    for point in np.unique(nearest):
        own = nearest == point
        slow = 1 + CAUTION * errors[own] / unit[point]
        np.testing.assert_allclose(factors[own], slow / slow.mean())
    np.testing.assert_allclose(caution(scale * errors, nearest, scale * unit), factors)


def test_of_two_candidates_as_far_the_one_of_less_error_is_chosen():
    candidates = np.array([[1.0, 0.01, 0], [1.0, -0.01, 0], [-1.0, 0, 0]])
    lengths = caution(np.array([0.5, 0.1, 0.1]), np.array([0, 0, 0]), np.ones(1))
    chosen = spread_out(candidates, np.linalg.norm(candidates, axis=1), np.zeros(3, int), np.array([2]), lengths)
    assert sorted(chosen) == [1, 2]
