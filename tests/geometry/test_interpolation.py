import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.interpolation import midpoint


def cloud(n, seed=0):
    return np.random.default_rng(seed).random((n, 3))


def midpoint_slowly(points, rate):
    """Every point with its 2·rate nearest, both copies of a pair kept, thinned."""
    middles = []
    for point in points:
        nearest = np.argsort(np.linalg.norm(points - point, axis=1))[: 2 * rate]
        middles += [(point + points[i]) / 2 for i in nearest]
    return np.array(middles)[farthest_points(np.array(middles), rate * len(points))]


def as_set(points):
    return {tuple(row) for row in np.round(points, 12)}


@pytest.mark.parametrize("rate", [1, 2, 4])
def test_midpoint_agrees_with_its_definition(rate):
    dense, slow = midpoint(cloud(40), rate), midpoint_slowly(cloud(40), rate)
    # Dropping copies moves the centroid, and with it the first point that thinning takes: not all agree.
    assert len(as_set(dense) & as_set(slow)) > 0.8 * 40 * rate
    assert len(as_set(dense)) == len(dense) == 40 * rate


def test_between_two_points_lies_one():
    dense = midpoint(np.array([[0.0, 0, 0], [2, 0, 0]]), 1)
    assert as_set(dense) <= {(0, 0, 0), (1, 0, 0), (2, 0, 0)}
    assert len(dense) == 2


@given(st.integers(8, 60), st.floats(1, 4), st.integers(1, 3), st.integers(0, 9))
@settings(max_examples=40, deadline=None)
def test_the_number_of_points_is_the_rate_times_as_many_and_none_leaves_the_hull(n, rate, passes, seed):
    dense = midpoint(cloud(n, seed), rate, passes)
    assert len(dense) == round(rate * n)
    assert (dense >= 0).all()
    assert (dense <= 1).all()


def test_two_passes_beat_one_on_a_curved_surface():
    sphere = cloud(256) - 0.5
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    sunk = [1 - np.linalg.norm(midpoint(sphere, 16, passes), axis=1).mean() for passes in (1, 2)]
    assert sunk[1] < 0.7 * sunk[0]


def test_points_that_coincide_are_enough_candidates():
    assert len(midpoint(np.repeat(cloud(4), 4, axis=0), 4)) == 64


@pytest.mark.parametrize(
    ("n", "rate", "passes", "message"),
    [
        (9, 0.5, 1, "rate is 0.5"),
        (9, 4, 0, "passes 0"),
        (7, 4, 1, "7 points are fewer than the 8 neighbours"),
        (0, 4, 1, "0 points"),
    ],
)
def test_what_cannot_be_interpolated_is_refused(n, rate, passes, message):
    with pytest.raises(UserError, match=message):
        midpoint(cloud(n), rate, passes)
