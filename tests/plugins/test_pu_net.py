"""PU-Net's parts: their sizes as published, and each against a slow and obvious form of itself."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn import functional as F

from pcsr import Trait, UserError, Widths
from pcsr.geometry.farthest import farthest_points
from pcsr.network.network import Network
from pcsr_plugins.backbones.pu_net import PUNet
from pcsr_plugins.encoders.set_abstraction import BallEncoder
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.farthest import farthest
from pcsr_plugins.layers.point_losses import matched_distance, repulsion
from pcsr_plugins.layers.set_abstraction import SetAbstraction, ball
from pcsr_plugins.objectives.pu_net import PUNetLoss
from pcsr_plugins.upsamplers.branches import Branches


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield


def close(a, b, atol=1e-5):
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


def pu_net(rate: int = 4) -> Network:
    encoder = BallEncoder(Widths(rate=rate))
    backbone = PUNet(Widths(visual=encoder.channels, rate=rate))
    upsampler = Branches(Widths(visual=encoder.channels, refined=backbone.channels, rate=rate))
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


# --- sizes


def test_pu_net_is_as_large_as_published():
    """PU-GCN publishes 812.0 K, of its own writing of PU-Net, whose branches hang on each other (see `Branches`)."""
    # PU-Net's own code: three of the four branches take 259 channels rather than 256.
    assert pu_net().parameter_count == 812_003 + 3 * (259 - 256) * 256 == 814_307


def test_the_backbone_gives_the_published_259_channels():
    assert PUNet(Widths(visual=64)).channels == 259


# --- set abstraction


@given(seed=st.integers(0, 10_000), n=st.integers(1, 30), samples=st.integers(1, 12), radius=st.floats(0.1, 3))
def test_a_ball_is_the_nearest_within_the_radius_filled_up_by_the_nearest(seed, n, samples, radius):
    generator = torch.Generator().manual_seed(seed)
    points, centres = torch.randn(1, n, 3, generator=generator), torch.randn(1, 4, 3, generator=generator)
    found, most = ball(centres, points, radius, samples)[0], 1
    for i, centre in enumerate(centres[0]):
        distance = (points[0] - centre).norm(dim=-1)
        order = distance.argsort()
        inside = [int(j) for j in order if distance[j] < radius][:samples] or [int(order[0])]
        most = max(most, len(inside))
        assert sorted(set(found[i].tolist())) == sorted(inside)
    assert found.shape[1] == most


@pytest.mark.parametrize("featured", [False, True])
def test_set_abstraction_is_a_pointnet_on_each_ball_forward_and_backward(featured):
    layer = SetAbstraction(6 if featured else 0, (8, 8, 5), radius=0.9, samples=4).double()
    points = torch.randn(2, 20, 3, dtype=torch.float64, requires_grad=True)
    centres = torch.randn(2, 7, 3, dtype=torch.float64, requires_grad=True)
    features = torch.randn(2, 20, 6, dtype=torch.float64, requires_grad=True) if featured else None
    rows = []
    for b in range(2):
        for centre in centres[b]:
            distance = (points[b] - centre).norm(dim=-1)
            order = distance.argsort()
            inside = [j for j in order if distance[j] < 0.9][:4] or order[:1]
            pointnet = []
            for j in inside:
                x = torch.cat([points[b, j] - centre, features[b, j]]) if featured else points[b, j] - centre
                for linear in (layer.first, *layer.others):
                    x = F.relu(linear(x))
                pointnet.append(x)
            rows.append(torch.stack(pointnet).amax(0))
    plain = torch.stack(rows).view(2, 7, 5)
    fast = layer(centres, points, features)
    close(fast, plain, 1e-9)
    towards = torch.randn_like(plain)
    wanted = (points, centres, *layer.parameters(), *([features] if featured else []))
    for a, b in zip(
        torch.autograd.grad(fast, wanted, towards), torch.autograd.grad(plain, wanted, towards), strict=True
    ):
        close(a, b, 1e-9)


def test_the_encoder_sees_differences_of_places_alone():
    encoder, points = BallEncoder(Widths(), radius=0.5).double(), torch.rand(2, 40, 3, dtype=torch.float64)
    features = encoder(points)
    assert features.shape == (2, 40, 64)
    assert features.std(1).amax() > 1e-3
    close(encoder(points + torch.tensor([3.0, -1, 2])), features, 1e-9)


# --- backbone


def test_farthest_points_of_fewer_are_the_first_of_more():
    points = torch.randn(2, 40, 3)
    rows = farthest(points, 20)
    assert torch.equal(farthest(points, 7), rows[:, :7])
    for b in range(2):
        assert torch.equal(rows[b], points[b, farthest_points(points[b].numpy(), 20)])
        assert farthest_points(rows[b].numpy(), 7, start=0).tolist() == list(range(7))  # a level of the level before


@torch.no_grad()
def test_the_backbone_is_its_levels_one_by_one():
    backbone = PUNet(Widths(visual=6), channels=(8, 12), radii=(0.5, 0.9), samples=5, reduced=4).double()
    points, features = torch.randn(2, 24, 3, dtype=torch.float64), torch.randn(2, 24, 6, dtype=torch.float64)
    for b in range(2):
        below, known, sides = points[b], features[b], [features[b], points[b]]
        for level, reduce in zip(backbone.levels, backbone.reduce, strict=True):
            start = None if len(below) == 24 else 0
            centres = below[farthest_points(below.numpy(), len(below) // 2, start)]
            known = level(centres[None], below[None], known[None])[0]
            below, carried = centres, []
            for point in points[b]:
                distance = (centres - point).square().sum(-1)
                nearest = distance.argsort()[:3]
                weights = 1 / distance[nearest].clamp_min(1e-8)
                carried.append((weights / weights.sum()) @ known[nearest])
            sides.insert(0, F.relu(reduce(torch.stack(carried))))
        close(backbone(points, features)[b], torch.cat(sides, dim=-1), 1e-5)


@pytest.mark.parametrize("n", [1, 2, 5, 17, 30])
@torch.no_grad()
def test_pu_net_takes_any_number_of_points(n):
    dense = pu_net()(torch.randn(2, n, 3), 4)
    assert dense.shape == (2, 4 * n, 3)
    assert dense.isfinite().all()


@torch.no_grad()
def test_pu_net_follows_a_permutation():
    network, points, shuffled = pu_net(), torch.rand(2, 60, 3), torch.randperm(60)
    assert all(Trait.PERMUTATION_EQUIVARIANT in part.traits for part in (network.encoder, network.backbone))
    dense, other = network(points, 4), network(points[:, shuffled], 4)
    close(other.view(2, 4, 60, 3), dense.view(2, 4, 60, 3)[:, :, shuffled])


# --- upsampler


@torch.no_grad()
def test_branches_lie_end_to_end():
    branches = Branches(Widths(refined=9, rate=3), channels=(7, 5), hidden=6)
    points, features = torch.randn(2, 4, 3), torch.randn(2, 4, 9)
    dense = branches(points, features, 3)
    for i in range(4):
        for j in range(3):
            inner = F.relu(branches.first[j](features[:, i]))
            close(dense[:, 4 * j + i], branches.regressor(F.relu(branches.second[j](inner))), 1e-6)


def test_branches_refuse_another_rate():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        Branches(Widths(refined=9, rate=3))(torch.randn(1, 5, 3), torch.randn(1, 5, 9), 4)


# --- objective


def test_the_objective_is_fidelity_and_repulsion():
    prediction, target = torch.rand(3, 12, 3), torch.rand(3, 12, 3)
    losses = PUNetLoss()(prediction, target)
    assert list(losses) == ["emd", "repulsion"]
    emd = matched_distance(prediction, target, squared=True).mean() / 3  # mean over the coordinates, too
    close(losses["emd"], 100 * emd)
    close(losses["repulsion"], repulsion(prediction).mean())
    halved = PUNetLoss(weight=50.0, repulsion=0.5)(prediction, target)
    close(sum(halved.values()), sum(losses.values()) / 2)


def test_a_few_steps_lower_the_loss_and_reach_every_weight():
    network, objective = pu_net(), PUNetLoss()
    truth = F.normalize(torch.randn(2, 128, 3), dim=-1)
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    totals = []
    for _ in range(12):
        optimizer.zero_grad()
        loss = sum(objective(network(truth[:, ::4], 4), truth).values())
        loss.backward()
        if not totals:
            assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in network.parameters())
        optimizer.step()
        totals.append(loss.item())
    assert totals[-1] < 0.7 * totals[0]
