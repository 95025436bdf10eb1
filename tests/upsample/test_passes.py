"""Passes in which a cloud grows, and the weights of its points in the shares of patches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.upsample.candidates import Midpoints
from pcsr.upsample.passes import GROWTH, LAST_RATE, RATE, Pass, passes, weights


@given(points=st.integers(16, 5000), rate=st.floats(1.0, 64.0), keep=st.booleans())
def test_passes_lead_to_the_count_by_no_more_than_the_growth(points, rate, keep):
    new = round(points * rate) - (points if keep else 0)
    plans = passes(points, max(new, 0), Midpoints(), keep)
    size = points
    for plan in plans[:-1]:
        assert plan.points == size
        size += plan.new
        assert size / plan.points <= GROWTH + 0.1
    assert plans[-1].points == size
    assert plans[-1].new == max(new, 0)
    assert [plan.first for plan in plans] == [True] + [False] * (len(plans) - 1)
    assert [plan.rate for plan in plans] == [RATE] * (len(plans) - 1) + [LAST_RATE]


def test_the_pass_of_a_margin_grows_as_much():
    assert Pass(100, 300, 4, False).of_margin(50) == Pass(50, 150, 4, False)
    assert Pass(100, 300, 4, True).of_margin(0).new == 0


def uneven(count=2000):
    """A square whose right half is four times as dense."""
    rng = np.random.default_rng(0)
    left = rng.random(count) < 0.2
    x = np.where(left, rng.uniform(0, 1, count), rng.uniform(1, 2, count))
    return np.column_stack([x, rng.uniform(0, 1, count), np.zeros(count)]), left


def test_in_the_first_pass_all_points_weigh_the_same():
    assert (weights(uneven()[0], Pass(2000, 1, 4, True)) == 1).all()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_of_an_uneven_cloud_the_density_is_kept(scale):
    cloud, left = uneven()
    weight = weights(scale * cloud, Pass(2000, 1, 4, False))
    assert weight[left].mean() == pytest.approx(weight[~left].mean(), rel=0.1)


def test_of_an_even_cloud_denser_regions_weigh_less_by_the_square_root_of_their_density():
    side = np.arange(40.0)
    even = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    even[:, 0] = np.where(even[:, 0] > 20, 20 + (even[:, 0] - 20) / 1.1, even[:, 0])
    cloud = np.column_stack([even, np.zeros(len(even))])
    weight = weights(cloud, Pass(1600, 1, 4, False))
    inner = (np.abs(cloud[:, 1] - 20) < 10) & (cloud[:, 0] > 5) & (cloud[:, 0] < 33)
    dense, sparse = inner & (cloud[:, 0] > 25), inner & (cloud[:, 0] < 15)
    assert weight[dense].mean() / weight[sparse].mean() == pytest.approx(1 / np.sqrt(1.1), rel=0.02)
    assert (weights(np.zeros((40, 3)), Pass(40, 1, 4, False)) == 1).all(), "points on one spot have no spacing"
