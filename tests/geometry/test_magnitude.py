"""Coordinates of any size."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pcsr.geometry.magnitude import ORDINARY, exponent, scaled


@given(power=st.integers(-1000, 1000), seed=st.integers(0, 99))
def test_scaling_is_exact_and_makes_them_ordinary(power, seed):
    points = np.ldexp(np.random.default_rng(seed).uniform(0.5, 1, (9, 3)), power)
    found = exponent([points[:4], points])
    assert found == (power if abs(power) > ORDINARY else 0)
    inside = scaled(points, -found)
    assert abs(np.log2(inside)).max() <= ORDINARY + 1
    assert scaled(inside, found).tobytes() == points.tobytes()


def test_ordinary_ones_are_not_copied_and_none_have_no_size():
    points = np.ones((2, 3))
    assert scaled(points, 0) is points
    assert exponent([]) == exponent([np.zeros((0, 3))]) == exponent([np.zeros((4, 3))]) == 0
