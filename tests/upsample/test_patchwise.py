"""The field's protocol: what goes into the network, and what is made of what comes out."""

import numpy as np
import pytest
import torch

from pcsr.contracts import Upsampler
from pcsr.errors import RunError
from pcsr.geometry.farthest import farthest_points
from pcsr.network.network import Network
from pcsr.recipe import Patches
from pcsr.upsample.patchwise import upsample_patches


class Copies(Network):
    """Stands in for a network: every point `rate` times, each a bit off, and a record of what it saw."""

    def __init__(self):
        torch.nn.Module.__init__(self)
        self.weight = torch.nn.Parameter(torch.zeros(()))
        self.upsampler = Upsampler()
        self.seen = []

    def forward(self, points, rate, touches=None):
        self.seen.append((points, touches))
        step = torch.arange(rate)[:, None] * 1e-3
        return (points[:, :, None] + step).flatten(1, 2)


def patches(points=16, rate=4, cover=3.0):
    return Patches(points=points, rate=rate, overlap=cover)


def cloud(n=100, seed=0):
    return np.random.default_rng(seed).normal(size=(n, 3)) * 20 + 300


def test_a_cloud_of_one_patch_goes_through_once():
    network = Copies()
    dense = upsample_patches(network, cloud(16), 4, [], patches())
    assert dense.shape == (64, 3)
    ((points, touches),) = network.seen
    assert points.shape == (1, 16, 3)
    assert touches is None


@pytest.mark.parametrize("rate", [4, 16])
def test_every_patch_is_in_its_own_sphere_and_each_pass_takes_what_the_last_one_made(rate):
    network = Copies()
    dense = upsample_patches(network, cloud(), rate, [], patches())
    assert dense.shape == (100 * rate, 3)
    seen = torch.cat([points for points, _ in network.seen])
    torch.testing.assert_close(seen.norm(dim=-1).amax(1), torch.ones(len(seen)))
    torch.testing.assert_close(seen.mean(1), torch.zeros(len(seen), 3), atol=1e-5, rtol=0)
    passes = [100] if rate == 4 else [100, 400]
    assert len(seen) == sum(int(np.ceil(3 * n / 16)) for n in passes)


def test_one_pass_is_patches_around_farthest_points_merged_and_thinned():
    """The steps one after another, in plain loops."""
    network, given = Copies(), cloud(60)
    dense = upsample_patches(network, given, 4, [], patches())
    centre = given.mean(0)
    local = (given - centre) / np.linalg.norm(given - centre, axis=1).max()
    expected = []
    for seed in local[farthest_points(local.astype(np.float32), 12)]:
        patch = local[np.linalg.norm(local - seed, axis=1).argsort()[:16]]
        middle = patch.mean(0)
        expected.append((patch - middle) / np.linalg.norm(patch - middle, axis=1).max())
    seen = torch.cat([points for points, _ in network.seen]).numpy()
    np.testing.assert_allclose(seen, expected, atol=1e-5)
    # Thinned by farthest points, of twelve copies of each point about the same number of each are left.
    nearest = np.linalg.norm(dense[:, None] - given, axis=2).argmin(1)
    assert np.linalg.norm(dense - given[nearest], axis=1).max() < 0.2
    assert np.bincount(nearest, minlength=60).min() >= 1


class Doubled(Upsampler):
    """Prepares the points and others beside them."""

    def prepare(self, points, rate):
        return points if rate == 1 else torch.cat([points, points + 0.01], 1)


def test_an_upsampler_that_interpolates_does_so_before_patches_are_cut():
    network = Copies()
    network.upsampler = Doubled()
    dense = upsample_patches(network, cloud(64), 4, [], patches())
    assert dense.shape == (256, 3)
    seen = torch.cat([points for points, _ in network.seen])
    assert seen.shape == (12, 32, 3)  # 128 points, each in three patches of twice as many points
    # Each point's copy is there too, but for those that the border cuts off.
    apart = torch.cdist(seen, seen)
    apart.diagonal(dim1=1, dim2=2).fill_(torch.inf)
    assert (apart.amin(2) < 0.1).float().mean() > 0.9


def test_touches_come_along_into_each_patch_and_are_there_where_they_are_near():
    network, given = Copies(), cloud()
    touch = given[np.linalg.norm(given - given[0], axis=1).argsort()[:3]]
    upsample_patches(network, given, 4, [touch, touch + 1000.0], patches())
    masks = torch.cat([touches.mask for _, touches in network.seen])
    assert masks[:, 0].any()
    assert not masks[:, 0].all()
    assert not masks[:, 1].any()
    # Touched points are points of the cloud: in a patch that has them all they lie where its own do.
    held = 0
    for points, touches in network.seen:
        for patch, felt_there, there in zip(points, touches.points[:, 0], touches.mask[:, 0], strict=True):
            assert bool(there) == (float(felt_there.mean(0).norm()) <= 1)
            held += bool((torch.cdist(felt_there, patch).amin(1) < 1e-4).all())
    assert held >= 1


def test_what_is_not_finite_is_told():
    class Broken(Copies):
        def forward(self, points, rate, touches=None):
            return super().forward(points, rate) * torch.nan

    with pytest.raises(RunError, match="not finite"):
        upsample_patches(Broken(), cloud(), 4, [], patches())
