import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr_plugins.shapes.shared.draw import CELLS, SPLITS, Draw

seeds = st.integers(0, 2**64 - 1)


@given(st.sampled_from(sorted(SPLITS)), seeds, st.floats(-100, 100), st.floats(0.01, 100))
def test_numbers_lie_in_the_range_and_in_a_cell_of_their_split(split, seed, low, width):
    draw = Draw(split, seed)
    number = draw(low, low + width)
    assert low <= number <= low + width
    place = (number - low) / width * CELLS
    if 1e-6 < place % 1 < 1 - 1e-6:
        assert int(place) % 10 in SPLITS[split]


def test_the_splits_share_no_cell_and_leave_none_out():
    cells = [cell for split in SPLITS.values() for cell in split]
    assert sorted(cells) == list(range(10))


def test_no_two_splits_draw_numbers_closer_than_chance_allows():
    drawn = {split: np.array([draw(0, 1) for _ in range(4000)]) for split in SPLITS for draw in [Draw(split, 1)]}
    for held_out in ("validation", "test"):
        taken = np.floor(drawn[held_out] * CELLS)
        assert not np.isin(np.floor(drawn["train"] * CELLS), taken).any()
        # ... and they still span the range: a held-out part is no stranger.
        assert drawn[held_out].min() < 0.2
        assert drawn[held_out].max() > 0.8
    assert not set(np.floor(drawn["validation"] * CELLS)) & set(np.floor(drawn["test"] * CELLS))


def test_numbers_fill_their_cells_evenly():
    numbers = np.array([draw(0, 1) for draw in [Draw("train", 0)] for _ in range(20_000)])
    counts = np.bincount((numbers * CELLS).astype(int), minlength=CELLS)
    used = counts[counts > 0]
    assert len(used) == 0.8 * CELLS
    assert used.min() > 400
    assert used.max() < 600


@given(seeds, st.integers(-5, 5), st.integers(0, 4))
def test_whole_numbers_include_both_ends(seed, low, more):
    draw = Draw("train", seed)
    assert {draw.whole(low, low + more) for _ in range(200)} == set(range(low, low + more + 1))


def test_choices_and_chances():
    draw = Draw("test", 0)
    assert {draw.one_of("abc") for _ in range(50)} == set("abc")
    assert 0.25 < np.mean([draw.maybe(0.3) for _ in range(2000)]) < 0.35
    assert not any(draw.maybe(0.0) for _ in range(50))


def test_one_seed_one_sequence():
    first, again, other = (Draw("train", seed) for seed in (7, 7, 8))
    numbers = [first(0, 1) for _ in range(5)]
    assert numbers == [again(0, 1) for _ in range(5)]
    assert numbers != [other(0, 1) for _ in range(5)]


def test_an_unknown_split_is_a_mistake_in_the_code():
    with pytest.raises(KeyError):
        Draw("val", 0)
