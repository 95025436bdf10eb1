"""Farthest points are those of the slow loop, however many are looked at at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pcsr import UserError
from pcsr.geometry import farthest
from pcsr.geometry.farthest import farthest_points

COORDINATES = {
    "any": st.floats(-1, 1, width=32).map(float),
    "few, so that distances tie and points coincide": st.integers(0, 3).map(float),
    "some that are not finite": st.sampled_from([0.0, 1.0, 2.5, np.nan, np.inf]),
}


def generator(seed=0):
    return np.random.default_rng(seed)


def farthest_slowly(points, count, start):
    chosen = [start]
    while len(chosen) < count:
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(1)
        distance[chosen] = -1
        chosen.append(int(distance.argmax()))
    return chosen


def in_rounds(points, count, start=None, alone=1, most=1024, share=0.97, fan=16):
    """As for a large cloud, whatever its size."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "PLAIN_SIZE": 0,
            "PLAIN_STEPS": alone,
            "ROUND_SIZE": most,
            "ROUND_SHARE": share,
            "BOX_SIZE": fan,
        }.items():
            patch.setattr(farthest, name, value)
        return farthest_points(points, count, start)


@given(arrays(np.float64, (25, 3), elements=st.integers(-3, 3).map(float)), st.integers(1, 25))
@settings(max_examples=60, deadline=None)
def test_farthest_points_agree_with_looking_at_every_distance(points, count):
    points += 0.1 * generator().random(points.shape)  # no ties, which would have several right answers
    assert farthest_points(points, count, start=3).tolist() == farthest_slowly(points, count, 3)
    first = int(np.linalg.norm(points - points.mean(0), axis=1).argmax())
    assert farthest_points(points, count).tolist() == farthest_slowly(points, count, first)


@given(arrays(np.float64, (30, 3), elements=st.integers(0, 2).map(float)), st.integers(1, 30), st.randoms())
@settings(max_examples=60, deadline=None)
def test_farthest_points_do_not_depend_on_the_order_even_where_distances_tie(points, count, random):
    order = random.sample(range(30), 30)
    ours, shuffled = points[farthest_points(points, count)], points[order]
    assert np.array_equal(ours, shuffled[farthest_points(shuffled, count)])


def test_farthest_points_of_coinciding_points_are_all_chosen_once():
    assert sorted(farthest_points(np.ones((9, 3), np.float32), 9)) == list(range(9))


def test_farthest_points_tell_neighbours_apart_in_coordinates_of_millions():
    points = generator().random((50, 3))
    assert np.array_equal(farthest_points(points + 5e6, 20), farthest_points(points, 20))


@pytest.mark.parametrize("kind", COORDINATES)
@given(st.data())
@settings(max_examples=100, deadline=None)
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
def test_rounds_choose_what_one_look_at_all_for_each_point_does(kind, data):
    n = data.draw(st.integers(1, 60))
    points = data.draw(arrays(np.float64, (n, 3), elements=COORDINATES[kind]))
    count, start = data.draw(st.integers(0, n)), data.draw(st.none() | st.integers(0, n - 1))
    alone, most, fan = (data.draw(st.integers(least, 20)) for least in (1, 1, 2))
    share = data.draw(st.sampled_from([0.2, 0.9, 0.97]))
    ours = in_rounds(points, count, start, alone, most, share, fan)
    assert ours.tolist() == farthest_points(points, count, start).tolist()


@pytest.mark.parametrize("lattice", [False, True])
def test_a_large_cloud_is_taken_in_rounds_with_the_same_result(lattice, monkeypatch):
    points = generator().random((20_000, 3)) * [1, 1, 0.1]
    if lattice:
        points = (points * 40).round()
    ours = farthest_points(points, 3000, start=7)
    monkeypatch.setattr(farthest, "PLAIN_SIZE", len(points))
    assert np.array_equal(ours, farthest_points(points, 3000, start=7))


def test_more_points_than_there_are_is_refused():
    with pytest.raises(UserError, match="8 points were asked of a cloud of 7"):
        farthest_points(np.zeros((7, 3)), 8)


def test_a_start_outside_the_cloud_is_refused():
    with pytest.raises(UserError, match="start at point 7 of a cloud of 7"):
        farthest_points(np.zeros((7, 3)), 2, start=7)
