"""The monomials against ones that are written out, and the slopes."""

import itertools
from math import comb, prod

import numpy as np
import pytest

from pcsr.sensors.polynomial import EXPONENTS, SCALE, STEEPEST, monomials, slopes


def naive(change, row, column, size):
    """Each product of at most three of red, green, blue, x and y, with repetition, that has a colour."""
    half = max(size) / 2
    values = [*(change / SCALE), (column - (size[1] - 1) / 2) / half, (row - (size[0] - 1) / 2) / half]
    found = {}
    for degree in (1, 2, 3):
        for factors in itertools.combinations_with_replacement(range(5), degree):
            if min(factors) < 3:
                found[tuple(factors.count(variable) for variable in range(5))] = prod(values[k] for k in factors)
    return found


@pytest.mark.parametrize("size", [(240, 320), (320, 240), (7, 9)])
def test_monomials_are_the_products(size):
    rng = np.random.default_rng(0)
    change = rng.normal(0, 60, (20, 3))
    rows, columns = rng.integers(0, size[0], 20) * 1.0, rng.integers(0, size[1], 20) * 1.0
    found = monomials(change, rows, columns, size)
    assert found.shape == (20, comb(8, 3) - comb(5, 3)) == (20, len(EXPONENTS))
    for pixel in range(20):
        expected = naive(change[pixel], rows[pixel], columns[pixel], size)
        assert expected.keys() == set(map(tuple, EXPONENTS.tolist()))
        for number, exponents in enumerate(EXPONENTS.tolist()):
            assert found[pixel, number] == pytest.approx(expected[tuple(exponents)], rel=1e-12, abs=1e-15)


def test_without_a_change_of_colour_all_are_0():
    rows, columns = (one.ravel() * 1.0 for one in np.mgrid[:6, :8])
    assert not monomials(np.zeros((48, 3)), rows, columns, (6, 8)).any()


def test_positions_are_relative_to_the_centre_and_1_at_the_end_of_the_longer_side():
    change = np.full((2, 3), SCALE)
    found = monomials(change, np.array([0.0, 239.0]), np.array([0.0, 319.0]), (240, 320))
    red_x = EXPONENTS.tolist().index([1, 0, 0, 1, 0])
    red_y = EXPONENTS.tolist().index([1, 0, 0, 0, 1])
    np.testing.assert_allclose(found[:, red_x], [-319 / 320, 319 / 320])
    np.testing.assert_allclose(found[:, red_y], [-239 / 320, 239 / 320])


def test_slopes_are_tangents_of_angles_that_have_a_bound():
    values = np.array([[0.5], [-0.2], [100.0]])
    found = slopes(values, np.array([[1.0, -2.0]]))
    expected = np.tan([[0.5, -1.0], [-0.2, 0.4], [STEEPEST, -STEEPEST]])
    np.testing.assert_allclose(found, expected)
