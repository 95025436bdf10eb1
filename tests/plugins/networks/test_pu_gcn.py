"""PU-GCN's network as a whole."""

from pathlib import Path

import pytest
import torch
from torch import nn

import pcsr
from pcsr import Trait, UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from tests.plugins.compare import close
from tests.plugins.published import pu_gcn, small_pu_gcn

RECIPES = Path(pcsr.__file__).parent / "recipes"
PUBLISHED = 75_971  # published as 76.0 K


@torch.no_grad()
def test_each_part_follows_a_permutation():
    net, points, shuffled = small_pu_gcn(), torch.randn(2, 31, 3), torch.randperm(31)
    assert all(Trait.PERMUTATION_EQUIVARIANT in part.traits for part in (net.encoder, net.backbone, net.upsampler))
    features = net.encoder(points)
    close(net.encoder(points[:, shuffled]), features[:, shuffled])
    refined = net.backbone(points, features)
    close(net.backbone(points[:, shuffled], features[:, shuffled]), refined[:, shuffled])
    dense = net.upsampler(points, refined, 4).view(2, 31, 4, 3)
    close(net.upsampler(points[:, shuffled], refined[:, shuffled], 4).view(2, 31, 4, 3), dense[:, shuffled])


def test_it_has_as_many_weights_as_published():
    registry = load_plugins()
    (recipe,) = load(RECIPES / "pu-gcn.yaml", registry)
    assert pu_gcn(recipe.patches.rate).parameter_count == build(recipe, registry).parameter_count == PUBLISHED


def test_each_further_point_costs_the_weights_of_an_edge_convolution():
    assert pu_gcn(5).parameter_count - pu_gcn(4).parameter_count == 2 * 64 * 64 + 64


def test_it_takes_a_patch_of_the_fields_size():
    assert pu_gcn()(torch.randn(2, 256, 3), 4).shape == (2, 1024, 3)


def test_training_lowers_the_loss_and_reaches_every_weight():
    net = small_pu_gcn()
    truth = nn.functional.normalize(torch.randn(2, 128, 3), dim=-1)
    points = truth[:, ::4]
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    losses = []
    for _ in range(25):
        loss = chamfer(net(points, 4), truth).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.8 * losses[0]
    for name, weight in net.named_parameters():
        assert weight.grad is not None, name
        assert weight.grad.abs().sum() > 0, name


def test_too_few_points_for_the_dilated_graph_are_refused():
    with pytest.raises(UserError, match="41 neighbours were asked of 40 points"):
        pu_gcn()(torch.randn(1, 40, 3), 4)
    pu_gcn()(torch.randn(1, 41, 3), 4)
