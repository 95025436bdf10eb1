"""Spacing, stray points, candidates within reach, and points between neighbours."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pcsr.upsample.gaps import between, spacing, strays, touched_ones, within_reach


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


def naive_spacings(points):
    """The spacing of each point."""
    away = np.linalg.norm(points[:, None] - points, axis=2)
    return np.sort(away, axis=1)[:, 1:7].mean(1)


def test_stray_points_are_those_far_from_their_neighbours_as_a_slow_loop_says():
    rng = np.random.default_rng(0)
    cloud = np.concatenate([rng.uniform(0, 1, (300, 3)) * [1, 1, 0], rng.uniform([0, 0, 0.3], [1, 1, 1.3], (6, 3))])
    own, away = naive_spacings(cloud), np.linalg.norm(cloud[:, None] - cloud, axis=2)
    ratio = own / [np.median(own[np.argsort(row)[:32]]) for row in away]
    limit = np.clip(1 + 6 * np.median(np.abs(ratio - np.median(ratio))), 1.5, 2)
    np.testing.assert_array_equal(strays(cloud), ratio > limit)
    assert strays(cloud)[300:].all()
    assert strays(cloud)[:300].mean() < 0.02


def test_an_even_cloud_and_copies_have_no_stray_points():
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0))
    grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(144)])
    assert not strays(grid).any()
    assert not strays(np.repeat(grid, 9, axis=0)).any()


def test_nothing_bridges_a_gap_and_what_fills_the_sampling_stays():
    rng = np.random.default_rng(0)
    left, right = (rng.uniform(0, 1, (400, 3)) * [1, 1, 0] + [x, 0, 0] for x in (0.0, 1.5))
    cloud = np.concatenate([left, right])
    candidates = np.column_stack([rng.uniform(0, 2.5, 5000), rng.uniform(0, 1, 5000), np.zeros(5000)])
    close, distance, nearest = within_reach(candidates, cloud, spacing(cloud))
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
    """Of the lines from one point to another: each point more lies elsewhere, and none in the other's half."""
    fractions = between(np.eye(3)[:2] - np.eye(3)[0], 1, 16)[:, 1]
    assert 0 < min(fractions) < max(fractions) < 0.5
    assert np.diff(sorted(fractions)).min() > 0.01


def test_candidates_are_touched_points_up_to_single_precision():
    rng = np.random.default_rng(0)
    touch, others = rng.uniform(-1, 1, (2, 50, 3))
    candidates = np.concatenate([touch.astype(np.float32), others, touch + np.array([0, 0, 1e-5])])
    np.testing.assert_array_equal(touched_ones(candidates, [touch[:20], touch[20:]]), np.arange(150) < 50)
    assert not touched_ones(candidates, []).any()
    assert touched_ones(candidates[:0], [touch]).shape == (0,)
