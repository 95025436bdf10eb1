"""New points go where the gaps are: as a slow loop would choose, and never across what is no gap of sampling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.upsample.gaps import _spread_fraction, between, spacing, spread_out, within_reach


def slowly(candidates, known, mine, count):
    """One by one, each the candidate farthest from all points so far."""
    so_far, free, chosen = list(known), list(range(len(candidates))), []
    while len(chosen) < count and any(mine[i] for i in free):
        if so_far:
            gaps = [min(np.linalg.norm(candidates[i] - p) for p in so_far) for i in free]
        else:
            gaps = [np.linalg.norm(candidates[i] - candidates.mean(0)) for i in free]
        best = free.pop(int(np.argmax(gaps)))
        so_far.append(candidates[best])
        if mine[best]:
            chosen.append(best)
    return chosen


def distance_to(points, candidates):
    """To the nearest of them; None where there is none."""
    return np.linalg.norm(candidates[:, None] - points, axis=2).min(1) if len(points) else None


@given(seed=st.integers(0, 500), known=st.integers(0, 6), count=st.integers(0, 30))
def test_the_fast_way_chooses_what_the_slow_one_does(seed, known, count):
    rng = np.random.default_rng(seed)
    candidates, there = rng.normal(size=(20, 3)), rng.normal(size=(known, 3))
    mine = rng.random(20) < 0.6
    chosen = spread_out(candidates, distance_to(there, candidates), mine, count)
    assert list(chosen) == slowly(candidates, there, mine, count)
    assert mine[chosen].all()
    assert len(chosen) == min(count, mine.sum())


@pytest.mark.parametrize("known", [0, 40])
def test_slabs_that_are_narrower_than_the_cloud_change_nothing(known):
    rng = np.random.default_rng(known)
    candidates, there = rng.uniform(-1, 1, (150, 3)) * [1, 0.3, 0.05], rng.uniform(-1, 1, (known, 3)) * [1, 0.3, 0.05]
    mine = candidates[:, 0] < 0.2
    chosen = spread_out(candidates, distance_to(there, candidates), mine, 60)
    assert list(chosen) == slowly(candidates, there, mine, 60)


def test_of_candidates_equally_far_the_first_along_x_is_taken():
    x = np.array([3.0, 1.0, 2.0, 0.0])
    row = np.column_stack([x, np.zeros((4, 2))])
    assert list(spread_out(row, np.ones(4), np.ones(4, bool), 4)) == [3, 1, 2, 0]


def test_candidates_on_one_spot_are_each_chosen_once():
    chosen = spread_out(np.zeros((5, 3)), np.ones(5), np.ones(5, bool), 5)
    assert sorted(chosen) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("distance", [None, np.zeros(0)])
def test_of_no_candidates_none_is_chosen(distance):
    assert spread_out(np.zeros((0, 3)), distance, np.zeros(0, bool), 3).shape == (0,)


def test_a_border_draws_no_more_points_than_the_middle():
    rng = np.random.default_rng(0)
    sheet = np.column_stack([rng.uniform(0, 1, (16_000, 2)), np.zeros(16_000)])
    mine = sheet[:, 0] < 0.5

    def at_the_border(points):
        """How dense the points are there, 1 being the mean."""
        return (points[:, 0] > 0.49).mean() / 0.02

    assert at_the_border(sheet[spread_out(sheet, None, mine, 1000)]) == pytest.approx(1, abs=0.2)
    alone = sheet[mine]
    pulled = alone[spread_out(alone, None, np.ones(len(alone), bool), 1000)]
    assert at_the_border(pulled) > 1.5, "without the others' candidates it does draw more"


def test_spacing_is_the_distance_between_neighbours():
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0))
    grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(144)]) * 0.5
    inner = (np.abs(grid[:, :2] - 2.75) < 2).all(1)
    assert (spacing(grid)[inner] >= 0.5).all()
    assert (spacing(grid)[inner] <= 0.5 * 2**0.5).all()


def test_a_stray_point_is_no_coarse_surface():
    rng = np.random.default_rng(0)
    cloud = np.concatenate([rng.uniform(0, 1, (400, 3)) * [1, 1, 0], [[0.5, 0.5, 3.0]]])
    assert spacing(cloud)[-1] < 2.5 * np.median(spacing(cloud))


def test_nothing_bridges_a_gap_and_what_fills_the_sampling_stays():
    rng = np.random.default_rng(0)
    left, right = (rng.uniform(0, 1, (400, 3)) * [1, 1, 0] + [x, 0, 0] for x in (0.0, 1.5))
    cloud = np.concatenate([left, right])
    candidates = np.column_stack([rng.uniform(0, 2.5, 5000), rng.uniform(0, 1, 5000), np.zeros(5000)])
    close, distance, nearest = within_reach(candidates, cloud)
    in_gap = (candidates[:, 0] > 1.1) & (candidates[:, 0] < 1.4)
    on_sheet = (candidates[:, 0] < 0.95) | (candidates[:, 0] > 1.55)
    assert not close[in_gap].any()
    assert close[on_sheet].mean() > 0.98
    brute = np.linalg.norm(candidates[:200, None] - cloud[None], axis=2)
    np.testing.assert_array_equal(nearest[:200], brute.argmin(1))
    np.testing.assert_allclose(distance[:200], brute.min(1))


@given(seed=st.integers(0, 200), count=st.integers(0, 200))
def test_points_between_are_as_many_as_asked_and_stay_close(seed, count):
    cloud = np.random.default_rng(seed).normal(size=(30, 3))
    made = between(cloud, 10, count)
    assert made.shape == (count, 3)
    if count:
        distance = np.linalg.norm(made[:, None] - cloud[None, :10], axis=2).min(1)
        assert (distance <= spacing(cloud)[:10].max() * (1 + 1e-9)).all()
        assert len(np.unique(made.round(9), axis=0)) > 0.8 * min(count, 60)


def test_points_between_do_not_mind_coinciding_points():
    assert np.isfinite(between(np.ones((8, 3)), 4, 20)).all()


def test_fractions_keep_apart_and_below_a_half():
    fractions = [_spread_fraction(turn) for turn in range(16)]
    assert 0 < min(fractions) < max(fractions) < 0.5
    assert np.diff(sorted(fractions)).min() > 0.01
