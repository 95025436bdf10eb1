"""PU-GCN's parts, each against a slow and obvious form of itself, and all of them together."""

from pathlib import Path

import pytest
import torch
from torch import nn

from pcsr import Trait, UserError, Widths
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network, build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.backbones.pu_gcn import PUGCN, DensePath
from pcsr_plugins.encoders.edge_conv import EdgeConv
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.edge_conv import EdgeConv as Layer
from pcsr_plugins.layers.edge_conv import graph
from pcsr_plugins.upsamplers.node_shuffle import NodeShuffle

RECIPES = Path(__file__).parents[2] / "pcsr/recipes"
PUBLISHED = 75_971  # published as 76.0 K


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(5)
        yield


def close(a: torch.Tensor, b: torch.Tensor, atol: float = 1e-5) -> None:
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


def whole(rate: int = 4) -> Network:
    """PU-GCN as published."""
    encoder = EdgeConv(Widths(rate=rate))
    backbone = PUGCN(Widths(visual=encoder.channels, rate=rate))
    upsampler = NodeShuffle(Widths(visual=encoder.channels, refined=backbone.channels, rate=rate))
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def small(rate: int = 4) -> Network:
    encoder = EdgeConv(Widths(rate=rate), channels=8, neighbours=5)
    backbone = PUGCN(Widths(visual=8, rate=rate), growth=6, neighbours=4)
    upsampler = NodeShuffle(Widths(refined=backbone.channels, rate=rate), channels=8, hidden=8, neighbours=5)
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def nearest(x: torch.Tensor, k: int) -> list[list[int]]:
    """For each row of (n d) the k nearest other rows."""
    distance = torch.cdist(x.double(), x.double(), compute_mode="donot_use_mm_for_euclid_dist")
    return [[int(j) for j in row.argsort() if j != i][:k] for i, row in enumerate(distance)]


def edge(layer: Layer, own: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """What one edge is before the maximum."""
    return torch.relu(layer.message(other - own) + layer.centre(own))


def dense_slowly(path: DensePath, x: torch.Tensor, near: list[list[int]]) -> torch.Tensor:
    rows = []
    for i, row in enumerate(near):
        edges = []
        for j in row:
            first = edge(path.edge, x[i], x[j])
            second = torch.relu(path.twice(torch.relu(path.twice(first))))
            third = torch.relu(path.last(torch.cat([first, second])))
            edges.append(torch.cat([first, second, third]))
        rows.append(torch.stack(edges).max(0).values)
    return torch.stack(rows)


def backbone_slowly(backbone: PUGCN, x: torch.Tensor) -> torch.Tensor:
    """Of one cloud's features (n c): neighbour by neighbour."""
    given = []
    for block in backbone.blocks:
        near = nearest(x, block.neighbours * block.dilation)
        reduced = torch.relu(block.reduce(x))
        y = torch.cat(
            [
                dense_slowly(block.near, reduced, [row[: block.neighbours] for row in near]),
                dense_slowly(block.far, reduced, [row[:: block.dilation] for row in near]),
                torch.stack([row.max() for row in x])[:, None],
            ],
            dim=1,
        )
        x = y + x if x.shape == y.shape else y
        given.append(x)
    return sum(given[1:], given[0]) / len(given)


def test_the_graph_has_the_nearest_others():
    x = torch.randn(2, 15, 6)
    assert graph(x, 4).tolist() == [nearest(x[0], 4), nearest(x[1], 4)]


def test_edge_convolution_is_the_edges_and_their_maximum():
    x = torch.randn(2, 15, 6)
    layer, near = Layer(6, 5), graph(x, 4)
    for b in range(2):
        for i in range(15):
            expected = torch.stack([edge(layer, x[b, i], x[b, j]) for j in near[b, i]]).max(0).values
            close(layer(x, near)[b, i], expected)


def test_the_encoder_is_an_edge_convolution_of_the_coordinates():
    encoder, points = EdgeConv(Widths(), channels=7, neighbours=4), torch.randn(1, 12, 3)
    for i, row in enumerate(nearest(points[0], 4)):
        expected = torch.stack([edge(encoder.layer, points[0, i], points[0, j]) for j in row]).max(0).values
        close(encoder(points)[0, i], expected)


@torch.no_grad()
def test_the_backbone_is_its_slow_form():
    backbone, features = PUGCN(Widths(visual=8), blocks=3, growth=4, neighbours=3).double(), torch.randn(2, 14, 8)
    refined = backbone(torch.randn(2, 14, 3), features.double())
    assert refined.shape == (2, 14, backbone.channels) == (2, 14, 25)
    for b in range(2):
        close(refined[b], backbone_slowly(backbone, features[b].double()), 1e-9)


def test_node_shuffle_cuts_a_points_channels_and_adds_the_ways_to_it():
    part = NodeShuffle(Widths(refined=10, rate=3), channels=6, hidden=7, neighbours=4)
    points, features = torch.randn(1, 12, 3), torch.randn(1, 12, 10)
    dense, reduced = part(points, features, 3), torch.relu(part.reduce(features[0]))
    assert dense.shape == (1, 36, 3)
    for i, row in enumerate(nearest(points[0], 4)):
        wide = torch.stack([edge(part.widen, reduced[i], reduced[j]) for j in row]).max(0).values
        for r in range(3):
            close(dense[0, 3 * i + r], points[0, i] + part.coordinates(wide[6 * r : 6 * r + 6]))


def test_node_shuffle_knows_only_the_graph_of_the_points_not_where_they_are():
    part = NodeShuffle(Widths(refined=10, rate=3), channels=6, hidden=7, neighbours=4)
    points, features = torch.randn(1, 12, 3), torch.randn(1, 12, 10)
    turn, shift = torch.linalg.qr(torch.randn(3, 3)).Q, torch.randn(3)
    ways = part(points, features, 3) - points.repeat_interleave(3, dim=1)
    moved = 2 * points @ turn + shift
    close(part(moved, features, 3) - moved.repeat_interleave(3, dim=1), ways)


@torch.no_grad()
def test_each_part_follows_a_permutation():
    net, points, shuffled = small(), torch.randn(2, 31, 3), torch.randperm(31)
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
    assert whole(recipe.patches.rate).parameter_count == build(recipe, registry).parameter_count == PUBLISHED


def test_each_further_point_costs_the_weights_of_an_edge_convolution():
    assert whole(5).parameter_count - whole(4).parameter_count == 2 * 64 * 64 + 64


def test_it_takes_a_patch_of_the_fields_size():
    assert whole()(torch.randn(2, 256, 3), 4).shape == (2, 1024, 3)


def test_training_lowers_the_loss_and_reaches_every_weight():
    net = small()
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


def test_node_shuffle_refuses_another_rate():
    with pytest.raises(UserError, match="built for rate 4, not 2: train one for rate 2"):
        small()(torch.randn(1, 30, 3), 2)


def test_too_few_points_for_the_dilated_graph_are_refused():
    with pytest.raises(UserError, match="41 neighbours were asked of 40 points"):
        whole()(torch.randn(1, 40, 3), 4)
    whole()(torch.randn(1, 41, 3), 4)
