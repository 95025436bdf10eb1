"""New points are chosen as a slow loop would choose them, and in proportion to the density of the cloud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.upsample.gaps import spacing
from pcsr.upsample.selection import CAUTION, caution, pattern, spread_out


def slowly(candidates, known, cell, quotas, lengths=None):
    """One by one, each the candidate farthest from all points so far, in its own unit, of a cell that is not full."""
    unit = np.ones(len(candidates)) if lengths is None else lengths
    so_far, free, chosen, left = list(known), list(range(len(candidates))), [], list(quotas)
    while any(cell[i] >= 0 and left[cell[i]] for i in free):
        if so_far:
            gaps = [min(np.linalg.norm(candidates[i] - p) for p in so_far) / unit[i] for i in free]
        else:
            gaps = [np.linalg.norm(candidates[i] - candidates.mean(0)) for i in free]
        best = free.pop(int(np.argmax(gaps)))
        so_far.append(candidates[best])
        if cell[best] >= 0:
            chosen.append(best)
            left[cell[best]] -= 1
            if left[cell[best]] == 0:
                free = [i for i in free if cell[i] != cell[best]]
    return chosen


def cells_of(mine):
    """One cell for those that are `mine`."""
    return np.where(mine, 0, -1)


def distance_to(points, candidates):
    """To the nearest of them; None where there is none."""
    return np.linalg.norm(candidates[:, None] - points, axis=2).min(1) if len(points) else None


@given(seed=st.integers(0, 500), known=st.integers(0, 6), quotas=st.lists(st.integers(1, 12), min_size=1, max_size=4))
def test_the_fast_way_chooses_what_the_slow_one_does(seed, known, quotas):
    rng = np.random.default_rng(seed)
    candidates, there = rng.normal(size=(20, 3)), rng.normal(size=(known, 3))
    cell = rng.integers(-1, len(quotas), 20)
    chosen = spread_out(candidates, distance_to(there, candidates), cell, np.array(quotas))
    assert list(chosen) == slowly(candidates, there, cell, quotas)
    counts = np.bincount(cell[chosen], minlength=len(quotas))
    assert counts.tolist() == [min(quota, (cell == k).sum()) for k, quota in enumerate(quotas)]


def test_a_cell_without_a_quota_gets_none():
    candidates = np.random.default_rng(0).normal(size=(20, 3))
    chosen = spread_out(candidates, np.ones(20), np.arange(20) % 2, np.array([0, 4]))
    assert len(chosen) == 4
    assert (chosen % 2 == 1).all()


@pytest.mark.parametrize("known", [0, 40])
def test_slabs_that_are_narrower_than_the_cloud_change_nothing(known):
    rng = np.random.default_rng(known)
    candidates, there = rng.uniform(-1, 1, (150, 3)) * [1, 0.3, 0.05], rng.uniform(-1, 1, (known, 3)) * [1, 0.3, 0.05]
    mine = candidates[:, 0] < 0.2
    chosen = spread_out(candidates, distance_to(there, candidates), cells_of(mine), np.array([60]))
    assert list(chosen) == slowly(candidates, there, cells_of(mine), [60])


def test_of_candidates_equally_far_the_first_along_x_is_taken():
    x = np.array([3.0, 1.0, 2.0, 0.0])
    row = np.column_stack([x, np.zeros((4, 2))])
    assert list(spread_out(row, np.ones(4), np.zeros(4, int), np.array([4]))) == [3, 1, 2, 0]


def test_candidates_on_one_spot_are_each_chosen_once():
    chosen = spread_out(np.zeros((5, 3)), np.ones(5), np.zeros(5, int), np.array([5]))
    assert sorted(chosen) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("distance", [None, np.zeros(0)])
def test_of_no_candidates_none_is_chosen(distance):
    assert spread_out(np.zeros((0, 3)), distance, np.zeros(0, int), np.array([3])).shape == (0,)


def test_a_border_draws_no_more_points_than_the_middle():
    rng = np.random.default_rng(0)
    sheet = np.column_stack([rng.uniform(0, 1, (16_000, 2)), np.zeros(16_000)])
    mine = sheet[:, 0] < 0.5

    def at_the_border(points):
        """How dense the points are there, 1 being the mean."""
        return (points[:, 0] > 0.49).mean() / 0.02

    assert at_the_border(sheet[spread_out(sheet, None, cells_of(mine), np.array([1000]))]) == pytest.approx(1, abs=0.2)
    alone = sheet[mine]
    pulled = alone[spread_out(alone, None, np.zeros(len(alone), int), np.array([1000]))]
    assert at_the_border(pulled) > 1.5, "without the others' candidates it does draw more"


@given(seed=st.integers(0, 300), count=st.integers(1, 30))
def test_with_lengths_of_their_own_too(seed, count):
    rng = np.random.default_rng(seed)
    candidates, known, mine = rng.normal(size=(30, 3)), rng.normal(size=(4, 3)), rng.random(30) < 0.7
    lengths = rng.uniform(0.5, 3, 30)
    chosen = spread_out(candidates, distance_to(known, candidates), cells_of(mine), np.array([count]), lengths)
    assert list(chosen) == slowly(candidates, known, cells_of(mine), [count], lengths)


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
