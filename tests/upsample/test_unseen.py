"""Touched points where the cloud has none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pcsr.upsample import unseen as module
from pcsr.upsample.gaps import REACH, spacing
from pcsr.upsample.unseen import EVEN, unseen


def sheet(rng, count, x=0.0, height=0.0):
    """Points of a square of side 1, from `x` on along the first axis."""
    return np.column_stack([x + rng.uniform(0, 1, count), rng.uniform(0, 1, count), np.full(count, height)])


def slow(points, touches):
    """One after the other, the farthest from those before, until one is too near."""
    own, touched = spacing(points), np.unique(np.concatenate(touches), axis=0)
    away = np.linalg.norm(touched[:, None] - points[None], axis=2)
    touched, apart = touched[away.min(1) > REACH * own[away.argmin(1)]], EVEN * np.median(own)
    kept = [int(np.linalg.norm(touched - touched.mean(0), axis=1).argmax())]
    while True:
        far = np.linalg.norm(touched[:, None] - touched[None, kept], axis=2).min(1)
        if far.max() < apart:
            return touched[kept]
        kept.append(int(far.argmax()))


@given(seed=st.integers(0, 999), count=st.integers(30, 300))
@settings(max_examples=20)
def test_they_are_those_of_the_slow_way(seed, count):
    rng = np.random.default_rng(seed)
    points, touches = sheet(rng, 100), [sheet(rng, count, 0.5), sheet(rng, count, 0, height=1.0)]
    np.testing.assert_array_equal(unseen(points, touches), slow(points, touches))


def test_where_the_cloud_has_points_none_are_new():
    x, y = np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 20))
    lattice = np.column_stack([x.ravel(), y.ravel(), np.zeros(400)])
    assert unseen(lattice, [sheet(np.random.default_rng(0), 200)]).shape == (0, 3)
    assert unseen(lattice, []).shape == (0, 3)


@pytest.mark.parametrize("seed", range(3))
def test_they_are_as_dense_as_the_clouds_own_points(seed):
    rng = np.random.default_rng(seed)
    points = sheet(rng, 1000)
    kept = unseen(points, [sheet(rng, 20_000, height=2.0)])
    assert cKDTree(kept).query(kept, k=2)[0][:, 1].min() >= EVEN * np.median(spacing(points))
    assert len(kept) == pytest.approx(1000, rel=0.1)


def test_beside_a_cloud_that_ends_they_are_no_sparser():
    rng = np.random.default_rng(0)
    above, beside = (unseen(sheet(rng, 1000), [sheet(rng, 20_000, *place)]) for place in ((0, 2.0), (1.0,)))
    assert len(beside) == pytest.approx(len(above), rel=0.15)


def test_however_many_are_tried_at_once_they_are_the_same(monkeypatch):
    rng = np.random.default_rng(0)
    points, touches = sheet(rng, 400), [sheet(rng, 3000, height=2.0)]
    kept = unseen(points, touches)
    assert len(kept) > module.FIRST, "or nothing would be tried again"
    monkeypatch.setattr(module, "FIRST", 10_000)
    np.testing.assert_array_equal(unseen(points, touches), kept)


def test_a_cloud_that_holds_its_points_several_times_is_as_good_as_once():
    rng = np.random.default_rng(0)
    points, touches = sheet(rng, 300), [sheet(rng, 500, height=1.0), sheet(rng, 100, height=1e-6)]
    np.testing.assert_array_equal(unseen(np.tile(points, (8, 1)), touches), unseen(points, touches))


def test_a_touch_of_few_points_gives_all_of_them():
    points = sheet(np.random.default_rng(0), 400)
    touched = np.array([[0.2, 0.2, 3.0], [0.8, 0.8, 3.0]])
    assert {tuple(p) for p in unseen(points, [touched[:1], touched[1:], touched])} == {tuple(p) for p in touched}


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_moving_turning_and_scaling_moves_them_alike(scale):
    rng = np.random.default_rng(0)
    points, touched = sheet(rng, 300), sheet(rng, 1000, height=1.5)
    turn, shift = Rotation.random(random_state=1).as_matrix(), np.array([3.0, -2.0, 1.0])
    there = unseen((points @ turn.T + shift) * scale, [(touched @ turn.T + shift) * scale])
    np.testing.assert_allclose(
        there, (unseen(points, [touched]) @ turn.T + shift) * scale, rtol=1e-6, atol=1e-9 * scale
    )
