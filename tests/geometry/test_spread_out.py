"""New points are chosen as a slow loop would choose them, and no more of a cell than its quota."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.geometry.spread_out import spread_out


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
