"""Patches of what a pass generated, with the true points around them."""

import pytest
import torch
from torch.nn import functional as F

from pcsr_plugins.layers.next_pass import COVERED, GROWTH, next_pass
from tests.plugins.surfaces import sphere

N = 64


def generated(points, count=9, reach=0.15):
    """Points on the sphere around each point, itself first."""
    random = torch.Generator().manual_seed(1)
    near = F.normalize(
        points.unsqueeze(2) + reach * torch.randn(*points.shape[:2], count - 1, 3, generator=random), dim=3
    )
    return torch.cat([points.unsqueeze(2), near], dim=2)


@pytest.fixture(scope="module")
def clouds():
    points, truth = sphere(0, N, rows=2), sphere(5, 16 * N, rows=2)
    return points, generated(points), truth


def test_a_patch_has_as_many_points_as_the_cloud_and_fills_the_unit_sphere(clouds):
    patch, near, covered = next_pass(*clouds)
    assert patch.shape == (2, N, 3)
    torch.testing.assert_close(patch.mean(1), torch.zeros(2, 3), atol=1e-6, rtol=0)
    torch.testing.assert_close(patch.norm(dim=2).amax(1), torch.ones(2))
    assert covered.shape[1] == COVERED * 16 * N / GROWTH
    assert torch.equal(near[:, : covered.shape[1]], covered), "those to be covered are among those measured to"


def test_patch_and_truth_are_in_the_same_frame(clouds):
    patch, near, covered = next_pass(*clouds)
    truth_spacing = torch.cdist(near, near).add_(9 * torch.eye(near.shape[1])).amin(2).mean()
    assert torch.cdist(patch, near).amin(2).max() < 4 * truth_spacing, "all points lie on the sphere, as the truth does"
    assert torch.cdist(covered, patch).amin(2).max() < 0.5, "what is to be covered lies within the patch"


def test_small_clouds_have_small_patches():
    points, truth = sphere(0, 8), sphere(2, 64)
    patch, near, covered = next_pass(points, generated(points), truth)
    assert patch.shape == (1, 8, 3)
    assert 0 < covered.shape[1] <= near.shape[1] <= 64
