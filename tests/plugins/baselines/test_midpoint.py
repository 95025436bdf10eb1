"""`midpoint`: interpolation without learning (Grad-PU, Sec. 3.2)."""

import numpy as np
import pytest

from pcsr.geometry.interpolation import midpoint
from pcsr_plugins.baselines.midpoint import Midpoint


@pytest.mark.parametrize(("rate", "passes"), [(1, 1), (4, 1), (15, 1), (16, 2)])
def test_it_interpolates_in_two_passes_from_rate_16_on(rate, passes):
    assert not Midpoint.needs_mesh
    points = np.random.default_rng(0).normal(size=(40, 3))
    dense = Midpoint().upsample(points, rate, None, np.random.default_rng(1))
    np.testing.assert_array_equal(dense, midpoint(points, rate, passes=passes))
