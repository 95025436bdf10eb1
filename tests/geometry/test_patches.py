"""Patches: every point in one core, margins next to it, the same however the cloud lies or is turned."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.geometry.frames import principal_axes
from pcsr.geometry.patches import cells, in_patch, patches


def cloud(count, seed=0):
    return np.random.default_rng(seed).gamma(2.0, size=(count, 3)) * [3.0, 2.0, 1.0]


@given(count=st.integers(1, 700), size=st.integers(8, 80), seed=st.integers(0, 99))
def test_each_point_is_in_the_core_of_one_patch(count, size, seed):
    points = cloud(count, seed)
    made = list(patches(points, size, size // 2))
    cores = np.concatenate([patch.rows[: patch.core] for patch in made])
    assert sorted(cores) == list(range(count))
    for patch in made:
        assert len(patch.rows) == len(set(patch.rows)) == min(size, count)
        assert patch.core <= size // 2 or len(made) == 1


@given(count=st.integers(2, 500), part=st.floats(0.1, 1), size=st.integers(8, 80), seed=st.integers(0, 99))
def test_cores_lie_within_a_part_of_the_cloud_and_margins_anywhere(count, part, size, seed):
    points = cloud(count, seed)
    within = np.sort(np.random.default_rng(seed).choice(count, max(1, round(part * count)), replace=False))
    made = list(patches(points, size, size // 2, within))
    assert sorted(np.concatenate([patch.rows[: patch.core] for patch in made])) == list(within)
    for patch in made:
        assert len(patch.rows) == len(set(patch.rows)) == min(size, count)


def test_a_margin_is_what_is_nearest_to_the_core():
    points = cloud(2000)
    for patch in patches(points, 64, 32):
        core, others = points[patch.rows[: patch.core]], np.delete(np.arange(2000), patch.rows)
        distance = np.linalg.norm(points[:, None] - core, axis=2).min(1)
        margin = distance[patch.rows[patch.core :]]
        assert (np.diff(margin) >= 0).all(), "the nearest first"
        centre = np.linalg.norm(points - core.mean(0), axis=1)
        around = np.sort(centre)[127]  # the margin is chosen among these
        assert margin.max() <= distance[others[centre[others] <= around]].min()


def test_cells_are_of_about_equal_size_and_round():
    points = np.random.default_rng(0).uniform(0, 1, (4096, 3)) * [4, 1, 1e-3]
    found = list(cells(points, 100))
    sizes = [len(rows) for rows in found]
    assert max(sizes) <= 100
    assert min(sizes) >= 60
    longest = [np.ptp(points[rows], axis=0)[:2] for rows in found]
    assert np.median([max(side) / min(side) for side in longest]) < 2.5


@given(seed=st.integers(0, 200))
def test_patches_turn_with_the_cloud_and_do_not_mind_its_order(seed):
    rng = np.random.default_rng(seed)
    points = cloud(300, seed)
    order = rng.permutation(300)
    turned = (points @ Rotation.random(random_state=seed).as_matrix().T * 0.01 + 1000)[order]
    one = [frozenset(patch.rows) for patch in patches(points, 40, 20)]
    other = [frozenset(order[patch.rows]) for patch in patches(turned, 40, 20)]
    assert one == other


@given(seed=st.integers(0, 200))
def test_principal_axes_turn_with_the_cloud(seed):
    points = cloud(60, seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    axes = principal_axes(points)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(principal_axes(points @ turn.T + 5), turn @ axes, atol=1e-6)


@pytest.mark.parametrize("points", [np.zeros((5, 3)), np.outer(np.arange(9.0), [1, 2, 3]), np.eye(3)])
def test_flat_straight_and_single_clouds_have_axes_too(points):
    axes = principal_axes(points)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)


def test_equal_points_are_cut_all_the_same():
    found = list(cells(np.ones((100, 3)), 7))
    assert sorted(np.concatenate(found)) == list(range(100))
    assert max(map(len, found)) <= 7


def test_a_touch_belongs_to_a_patch_if_its_middle_lies_in_its_sphere():
    touches = torch.tensor([[[0.0, 0, 0], [1.8, 0, 0]], [[0.9, 0, 0], [1.3, 0, 0]], [[0.0, 0, 5], [0.0, 0, -5]]])
    assert in_patch(touches).tolist() == [True, False, True]
