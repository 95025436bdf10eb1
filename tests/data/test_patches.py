"""Batches of patches."""

import dataclasses

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr.data.batches import Batches
from tests.data.splits import PATCHES, split


def patched(*augment, touches=(0, 3), seed=5):
    return Batches(split(), 4, touches, augment, seed, PATCHES)


@given(seed=st.integers(0, 20))
def test_a_patch_is_the_neighbourhood_of_a_point_and_its_sparse_cloud_part_of_it(seed):
    made = patched(touches=(0, 0), seed=seed)
    batch = made.at(0)
    assert batch.points.shape == (4, 5, 3)
    assert batch.truth.shape == (4, 15, 3)
    for points, truth in zip(batch.points, batch.truth, strict=True):
        whole = truth[torch.cdist(points, truth).argmin(1)]
        torch.testing.assert_close(points, whole, atol=1e-5, rtol=0)
    order = np.random.default_rng((seed, 0)).permutation(7)[:4]
    for item, truth in zip(order, batch.truth, strict=True):
        _assert_a_neighbourhood(made.split.truth[item], truth)


def _assert_a_neighbourhood(whole, patch):
    """Up to scale and place, the patch is some point's 15 nearest."""
    spread = torch.cdist(patch, patch)
    for seed in range(len(whole)):
        near = whole[(whole - whole[seed]).norm(dim=1).argsort()[:15]]
        own = torch.cdist(near, near)
        if torch.allclose((own / own.max()).sort().values, (spread / spread.max()).sort().values, atol=1e-3):
            return
    raise AssertionError("no point has these for its nearest")


def test_some_touches_belong_to_a_patch_and_some_do_not():
    made = patched("rotate", "scale", touches=(3, 3))
    masks = torch.cat([made.at(step).touches.mask for step in range(30)])
    assert masks.shape[1] == 3
    assert 0 < masks.float().mean() < 1


def test_many_patches_are_around_a_touch():
    given = split()
    touched = [0.01 * touch + truth[0] for touch, truth in zip(given.touches, given.truth, strict=True)]
    far = dataclasses.replace(given, touches=touched)
    made = Batches(far, 7, (1, 1), (), 0, PATCHES)
    at_touch = [row.any() for step in range(20) for row in made.at(step).touches.mask]
    assert 0.5 < np.mean(at_touch) < 1
