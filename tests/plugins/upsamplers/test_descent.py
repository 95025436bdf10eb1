"""`descent`: positions that go down the predicted distance (Grad-PU)."""

import pytest
import torch

from pcsr import Trait
from pcsr.geometry.interpolation import midpoint
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.network.network import Network
from tests.plugins.compare import close
from tests.plugins.published import far, lively, small_grad_pu


@pytest.mark.parametrize("rate", [1, 2, 4, 16])
def test_one_instance_serves_every_rate_and_starts_at_the_midpoints(rate):
    network, points = lively(small_grad_pu()).eval(), torch.randn(2, 20, 3)
    assert {Trait.ANY_RATE, Trait.PERMUTATION_EQUIVARIANT} <= network.upsampler.traits
    start = network.upsampler.prepare(points, rate)
    ordered = along(hilbert_order(points), points)
    passes = 2 if rate == 16 else 1
    for b in range(2):
        cloud = ordered[b].double().numpy()
        expected = points[b] if rate == 1 else torch.from_numpy(midpoint(cloud, rate, passes)).float()
        assert torch.equal(start[b], expected)
    network.upsampler.step = 0.0
    dense = network.upsampler(points, network.refine(points)[1], rate).detach()
    assert torch.equal(dense, ordered if rate == 1 else start)


def uphill(network: Network) -> Network:
    """One whose distance is that from the plane z = −1, wherever features say."""
    with torch.no_grad():
        for layer in network.upsampler.layers:
            layer.weight.zero_()
            layer.bias.zero_()
            layer.weight[0, 0] = 1.0
        network.upsampler.layers[0].weight[0, :3] = torch.tensor([0.0, 0.0, 1.0])
        network.upsampler.layers[0].weight[0, 3:] = 0.0
        network.upsampler.layers[0].bias[0] = 1.0
    return network


def test_points_go_down_to_where_the_distance_is_0_each_by_its_own_step():
    network = uphill(small_grad_pu(step=0.01)).eval()
    for count in (1, 30):
        candidates = torch.rand(2, count, 3) * 0.15 - torch.tensor([0.0, 0.0, 1.0])  # 0 to 0.15 above the plane
        cloud, features = network.refine(torch.randn(2, 20, 3))
        moved = network.upsampler.descend(candidates, cloud, features).detach()
        close(moved[..., :2], candidates[..., :2], 1e-7)
        height = candidates[..., 2] + 1
        close(moved[..., 2], candidates[..., 2] - 0.01 * torch.ceil(height / 0.01).clamp_max(10), 1e-6)


def test_what_is_too_far_away_stays():
    network = uphill(small_grad_pu(step=0.01)).eval()
    cloud, features = network.refine(torch.randn(1, 20, 3))
    for height, moves in ((0.19, True), (0.21, False)):
        candidates = torch.tensor([[[0.0, 0.0, height - 1]]])
        assert torch.equal(network.upsampler.descend(candidates, cloud, features), candidates) is not moves


@pytest.mark.parametrize("rate", [1, 4])
@torch.no_grad()
def test_the_order_of_the_points_does_not_matter(rate):
    network, points, shuffled = far(small_grad_pu(step=0.05)), torch.randn(2, 30, 3), torch.randperm(30)
    close(network(points[:, shuffled], rate), network(points, rate), 1e-5)


@pytest.mark.parametrize("mode", [torch.no_grad, torch.inference_mode])
@pytest.mark.parametrize("rate", [1, 4])
def test_it_descends_whether_gradients_are_recorded_or_not(mode, rate):
    network, points = far(small_grad_pu(step=0.05)).double(), torch.randn(2, 20, 3).double()
    recorded = network(points, rate)
    assert recorded.requires_grad
    with mode():
        silent = network(points * 1.0, rate)
    assert not silent.requires_grad
    assert not points.requires_grad
    close(silent, recorded.detach(), 1e-10)
    network.upsampler.step = 0.0
    assert (silent - network(points, rate)).abs().max() > 1e-4


@pytest.mark.parametrize("seed", range(10))
@torch.no_grad()
def test_untrained_it_gives_no_place_the_distance_0_from_where_nothing_is_learned(seed):
    torch.manual_seed(seed)
    network, points = small_grad_pu(), torch.randn(2, 40, 3)
    assert network.upsampler.distance(points, *network.refine(points)).min() > 0


@pytest.mark.parametrize("rate", [1, 4])
def test_where_gradients_are_recorded_the_result_has_one_by_the_features(rate):
    network = far(small_grad_pu(step=0.1))
    points = torch.randn(1, 20, 3)
    features = network.refine(points)[1].detach().requires_grad_()
    network.upsampler(points, features, rate).square().sum().backward()
    assert features.grad.isfinite().all()
    assert features.grad.abs().max() > 0
