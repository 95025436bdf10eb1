"""An even cloud in which touched points keep their positions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pcsr import UserError
from pcsr.geometry.anchoring import CLEARANCE, TOUCHED_SPACING, even_subset, subset_spacing
from pcsr.geometry.farthest import farthest_points


def sphere(rng, count):
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def square(rng, count):
    return np.column_stack([rng.uniform(-1, 1, (count, 2)), np.zeros(count)])


def patch(rng, count, half=0.35):
    """Points of a touch: a part of the square, and far denser than the result."""
    return np.column_stack([rng.uniform(-half, half, (count, 2)), np.zeros(count)])


def slow_spacing(points, count):
    """The median distance from one of the farthest points to the nearest other, by looking at all."""
    chosen = points[farthest_points(points, count)]
    apart = np.linalg.norm(chosen[:, None] - chosen[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return np.median(apart.min(1))


def slow_left(points, count, touched):
    """Touched points that keep apart, as long as they do, and the guessed ones that are no touched one's neighbour."""
    guessed = range(touched, len(points))
    gap = subset_spacing(points[touched:], count)
    contact = []
    for i in farthest_points(points[:touched], touched).tolist():
        if any(np.linalg.norm(points[i] - points[j]) < TOUCHED_SPACING * gap for j in contact) and len(
            contact
        ) >= count - len(guessed):
            break
        contact.append(i)
    clear = [i for i in guessed if min(np.linalg.norm(points[i] - p) for p in points[:touched]) >= CLEARANCE * gap]
    return [*contact, *clear]


@pytest.mark.parametrize("surface", [sphere, square])
@pytest.mark.parametrize(("made", "kept"), [(60, 20), (200, 200), (500, 200), (2000, 1000), (3000, 600)])
@pytest.mark.parametrize("seed", range(3))
def test_the_spacing_is_about_that_of_the_points_themselves(surface, made, kept, seed):
    points = surface(np.random.default_rng(seed), made)
    assert subset_spacing(points, kept) == pytest.approx(slow_spacing(points, kept), rel=0.25)


@given(seed=st.integers(0, 1000), scale=st.floats(1e-2, 1e2))
@settings(max_examples=20)
def test_the_spacing_has_the_unit_of_the_points_and_does_not_depend_on_their_order(seed, scale):
    rng = np.random.default_rng(seed)
    points = sphere(rng, 300)
    assert subset_spacing(rng.permutation(points), 150) == subset_spacing(points, 150)
    assert subset_spacing(scale * points, 150) == pytest.approx(scale * subset_spacing(points, 150), rel=1e-3)


@given(seed=st.integers(0, 1000), count=st.integers(1, 80), touched=st.integers(0, 60))
@settings(max_examples=60)
def test_as_many_as_asked_for_each_once_and_those_of_the_slow_way(seed, count, touched):
    rng = np.random.default_rng(seed)
    points = np.concatenate([patch(rng, touched), square(rng, 80)])
    kept = even_subset(points, count, touched)
    assert len(kept) == len(set(kept.tolist())) == count
    left = slow_left(points, count, touched) if touched else list(range(80))
    if len(left) >= count:
        assert kept.tolist() == [left[i] for i in farthest_points(points[left], count)]


def test_without_touches_they_are_the_farthest_points():
    points = sphere(np.random.default_rng(0), 300)
    assert np.array_equal(even_subset(points, 100), farthest_points(points, 100))


@given(seed=st.integers(0, 1000))
@settings(max_examples=10)
def test_a_touched_region_consists_of_touched_points_and_is_no_denser_than_the_rest(seed):
    rng = np.random.default_rng(seed)
    touched, count = 1000, 600
    points = np.concatenate([patch(rng, touched), square(rng, 4800)])
    kept = even_subset(points, count, touched)
    contact, guessed = points[kept[kept < touched]], points[kept[kept >= touched]]
    gap = CLEARANCE * subset_spacing(points[touched:], count)
    assert cKDTree(points[:touched]).query(guessed)[0].min() >= gap
    assert not (np.abs(guessed) < 0.35 - gap).all(1).any()
    inside = len(contact) / 0.7**2
    outside = ((np.abs(guessed) > 0.4).any(1) & (np.abs(guessed) < 0.95).all(1)).sum() / (1.9**2 - 0.8**2)
    assert inside == pytest.approx(outside, rel=0.25)


def test_which_are_kept_does_not_depend_on_the_order():
    rng = np.random.default_rng(3)
    contact, guessed = patch(rng, 60), square(rng, 200)
    points = np.concatenate([contact, guessed])
    other = np.concatenate([rng.permutation(contact), rng.permutation(guessed)])
    one, two = points[even_subset(points, 120, 60)], other[even_subset(other, 120, 60)]
    assert {tuple(p) for p in one} == {tuple(p) for p in two}


def test_where_no_point_can_be_spared_the_guessed_ones_farthest_from_touched_ones_stay():
    """Each of a few touched points would take the place of several others, and too few would be left."""
    lattice = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0), [0.0]), -1).reshape(-1, 3)
    contact = np.array([[1.4, 1.5, 0], [6.4, 1.5, 0], [1.4, 6.5, 0], [6.4, 6.5, 0], [4.4, 4.5, 0]])
    points = np.concatenate([contact, lattice])
    assert len(slow_left(points, 100, 5)) == 85
    kept = even_subset(points, 100, 5)
    away = np.linalg.norm(lattice[:, None] - contact[None], axis=2).min(1)
    gone = np.setdiff1d(np.arange(5, 105), kept) - 5
    assert set(range(5)) <= set(kept.tolist())
    assert len(gone) == 5
    assert away[gone].max() <= np.delete(away, gone).min()


def test_touched_points_alone_may_be_enough_or_all_there_are():
    rng = np.random.default_rng(2)
    points = patch(rng, 50)
    assert np.array_equal(np.sort(even_subset(points, 50, 50)), np.arange(50))
    assert np.array_equal(even_subset(points, 20, 50), farthest_points(points, 20))


def test_too_few_are_refused():
    points = square(np.random.default_rng(0), 30)
    for touched in (0, 10):
        with pytest.raises(UserError, match="31 points were asked of a cloud of 30"):
            even_subset(points, 31, touched)


def test_what_is_not_finite_is_left_to_those_who_measure():
    points = square(np.random.default_rng(0), 30)
    points[20] = np.nan
    assert len(even_subset(points, 12, 10)) == 12
