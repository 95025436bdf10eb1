"""The upsampler that refines an interpolated cloud."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from torch import nn

import pcsr
from pcsr import Trait, UserError, Widths
from pcsr.experiments.methods import methods
from pcsr.geometry.interpolation import midpoint
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.metrics.chamfer import chamfer
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.backbones.pu_transformer import PUTransformer
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.midpoints import evenly, interpolated
from pcsr_plugins.upsamplers.midpoint import Midpoint
from tests.plugins.compare import close

RECIPE = Path(pcsr.__file__).parent / "recipes" / "tapsr-midpoint.yaml"


def trained(refined: int = 6, hidden: int = 5) -> Midpoint:
    """One that moves points."""
    part = Midpoint(Widths(refined=refined), hidden=hidden)
    nn.init.normal_(part.mlp[-1].weight)
    nn.init.normal_(part.mlp[-1].bias)
    return part


@pytest.mark.parametrize("rate", [1, 2, 4, 16])
def test_untrained_it_is_the_interpolation_that_evaluation_sets_beside_it(rate):
    points, features = torch.randn(2, 40, 3), torch.randn(2, 40, 6)
    registry = load_plugins()
    (recipe,) = load(RECIPE, registry, [f"data.rate={rate}"])
    beside = methods(recipe, build(recipe, registry), registry)[1]
    assert beside.name == "midpoint"
    dense = Midpoint(Widths(refined=6)).eval()(points, features, rate)
    for ours, cloud in zip(dense, points, strict=True):
        assert np.array_equal(ours.detach().numpy(), beside.upsample(cloud.double().numpy(), []).astype(np.float32))


@torch.no_grad()
def test_it_moves_each_place_by_what_is_around_it_in_units_of_the_spacing():
    part, points, features = trained().double().eval(), torch.randn(2, 20, 3).double(), torch.randn(2, 20, 6).double()
    dense, tied = part(points, features, 4), 0
    for b in range(2):
        apart = torch.cdist(points[b], points[b]).sort().values[:, 1:9].mean(1)
        for i, place in enumerate(torch.from_numpy(midpoint(points[b].numpy(), 4))):
            distance = (points[b] - place).norm(dim=-1)
            if distance.sort().values[2:4].diff() < 1e-9:  # a midpoint's two ends are equally near: either may be third
                tied += 1
                continue
            nearest = distance.argsort()[:3]
            weight = 1 / (distance[nearest] + 1e-8)
            weight = weight / weight.sum()
            unit = weight @ apart[nearest]
            placed = torch.cat([place - weight @ points[b, nearest], distance.min()[None]]) / unit
            first = part.carried(weight @ features[b, nearest]) + part.placed(placed)
            close(dense[b, i], place + unit * part.mlp(first), 1e-5)
    assert tied < 0.2 * 160


@pytest.mark.parametrize("rate", [2, 4, 16])
def test_in_training_the_places_are_other_midpoints_of_the_same_cloud_nearly_as_even(rate):
    points, features = torch.randn(1, 60, 3), torch.randn(1, 60, 6)
    part = Midpoint(Widths(refined=6))
    dense, even = (part.train(mode)(points, features, rate).detach()[0].numpy() for mode in (True, False))
    assert len(np.unique(dense, axis=0)) == len(dense) == 60 * rate
    if rate < 16:
        middles = ((points[0, :, None] + points[0]) / 2).flatten(0, 1).numpy()
        assert (cKDTree(middles).query(dense)[0] < 1e-6).all()
    gap, widest = (cKDTree(cloud).query(cloud, 2)[0][:, 1] for cloud in (dense, even))
    assert gap.mean() > 0.85 * widest.mean()


def test_in_training_the_same_cloud_has_the_same_places():
    part, points, features = trained(), torch.randn(1, 40, 3), torch.randn(1, 40, 6)
    assert torch.equal(part(points, features, 4), part(points, features, 4))


def test_one_instance_serves_every_rate():
    part, points, features = trained(), torch.randn(1, 40, 3), torch.randn(1, 40, 6)
    assert Trait.ANY_RATE in part.traits
    for rate in (1, 2, 3, 5, 16):
        assert part(points, features, rate).shape == (1, 40 * rate, 3)


@pytest.mark.parametrize("training", [False, True])
def test_the_order_of_the_points_does_not_matter(training):
    part, points, features, shuffled = trained(), torch.randn(2, 30, 3), torch.randn(2, 30, 6), torch.randperm(30)
    assert Trait.PERMUTATION_EQUIVARIANT in part.train(training).traits
    close(part(points[:, shuffled], features[:, shuffled], 4), part(points, features, 4))


def test_a_larger_cloud_becomes_a_larger_cloud():
    part, points, features = trained(), torch.randn(1, 30, 3), torch.randn(1, 30, 6)
    close(part(4 * points, features, 4), 4 * part(points, features, 4), 1e-4)


def test_points_that_coincide_give_finite_points_and_gradients():
    part, points = trained(), torch.randn(1, 4, 3).repeat_interleave(10, dim=1)
    features = torch.randn(1, 40, 6, requires_grad=True)
    dense = part(points, features, 4)
    dense.sum().backward()
    assert dense.isfinite().all()
    assert all(weight.grad.isfinite().all() for weight in part.parameters())


def test_it_says_why_it_cannot_be_exported():
    part, points, features = trained(), torch.randn(1, 40, 3), torch.randn(1, 40, 6)
    with pytest.raises(UserError, match="no graph knows: export a network with another upsampler"):
        torch.export.export(part, (points, features, 4))


def test_too_few_points_are_refused():
    with pytest.raises(UserError, match="7 points are fewer than the 8 neighbours"):
        trained()(torch.randn(1, 7, 3), torch.randn(1, 7, 6), 4)


def test_training_starts_at_the_interpolation_lowers_the_loss_and_reaches_every_weight():
    backbone = PUTransformer(Widths(visual=8), channels=(8, 16), neighbours=6)
    net = Network(
        Mlp(Widths(), channels=8), None, NoFusion(Widths()), backbone, Midpoint(Widths(refined=16), hidden=16)
    )
    truth = nn.functional.normalize(torch.randn(2, 160, 3), dim=-1)
    points = truth[:, ::4]
    start = chamfer(interpolated(along(hilbert_order(points), points), 4, evenly), truth).mean()
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    losses = []
    for _ in range(60):
        loss = chamfer(net(points, 4), truth).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[0] == float(start)
    assert losses[-1] < 0.8 * losses[0]
    for name, weight in net.named_parameters():
        assert weight.grad is not None, name
        if not name.endswith("key.bias"):  # softmax does not depend on it
            assert weight.grad.abs().sum() > 0, name
