"""Dense edge convolutions against the words of the papers, edge by edge."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import Trait, UserError, Widths
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.layers.dense_edge_conv import DenseEdgeConv


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield


def literal(block: DenseEdgeConv, x: torch.Tensor) -> torch.Tensor:
    """One cloud (n c), one point and one edge at a time."""
    rows = []
    for i, own in enumerate(x):
        distance = (x - own).norm(dim=-1)
        nearest = [j for j in distance.argsort().tolist() if j != i][: block.neighbours]
        edges = []
        for j in nearest:
            y = F.relu(block.layers[0](torch.cat([own, x[j] - own])))
            dense = torch.cat([y, own])
            for layer in block.layers[1:-1]:
                dense = torch.cat([F.relu(layer(dense)), dense])
            edges.append(torch.cat([block.layers[-1](dense), dense]))
        rows.append(torch.stack(edges).amax(0))
    return torch.stack(rows)


@pytest.mark.parametrize("layers", [2, 3, 4])
def test_a_block_is_its_edges_one_by_one_forward_and_backward(layers):
    block, x = DenseEdgeConv(5, 4, layers, 6).double(), torch.randn(2, 17, 5, dtype=torch.float64, requires_grad=True)
    fast, slow = block(x), torch.stack([literal(block, cloud) for cloud in x])
    assert fast.shape == (2, 17, block.channels) == (2, 17, 5 + 4 * layers)
    torch.testing.assert_close(fast, slow)
    towards, wanted = torch.randn_like(fast), (x, *block.parameters())
    for a, b in zip(*(torch.autograd.grad(y, wanted, towards) for y in (fast, slow)), strict=True):
        torch.testing.assert_close(a, b)


def test_a_block_of_one_layer_has_no_activation():
    block = DenseEdgeConv(2, 3, 1, 1)
    with torch.no_grad():
        for weight in block.parameters():
            weight.fill_(-1)
    x = torch.tensor([[[1.0, 0.0], [3.0, 0.0]]])
    # −(xᵢ + xⱼ − xᵢ) − 1, from each point to the other one.
    assert block(x)[0, :, 0].tolist() == [-4, -2]


def test_neighbours_are_the_nearest_by_features():
    """Moved far away in space, a point changes nothing as long as its features stay."""
    backbone, features = DenseEdgeConvs(Widths(visual=6), blocks=2, neighbours=4), torch.randn(1, 12, 6)
    assert torch.equal(backbone(torch.randn(1, 12, 3), features), backbone(torch.randn(1, 12, 3), features))


def test_the_backbone_sees_all_that_came_before():
    backbone, features = DenseEdgeConvs(Widths(visual=6), blocks=3, between=5, neighbours=4), torch.randn(2, 12, 6)
    first = torch.cat([backbone.blocks[0](features), features], dim=-1)
    second = torch.cat([backbone.blocks[1](F.relu(backbone.narrow[0](first))), first], dim=-1)
    third = torch.cat([backbone.blocks[2](F.relu(backbone.narrow[1](second))), second], dim=-1)
    refined = backbone(torch.randn(2, 12, 3), features)
    assert refined.shape[-1] == backbone.channels
    torch.testing.assert_close(refined, third)


def test_the_backbone_is_as_wide_and_as_large_as_published():
    backbone = DenseEdgeConvs(Widths(visual=24))
    assert backbone.channels == 480
    # Blocks of 4,104 and thrice 6,408 weights; layers between them of 5,808, 11,568 and 17,328.
    assert sum(weight.numel() for weight in backbone.parameters()) == 4_104 + 3 * 6_408 + 5_808 + 11_568 + 17_328


def test_the_backbone_follows_a_permutation():
    backbone = DenseEdgeConvs(Widths(visual=8), neighbours=5).double()
    points, features = torch.randn(2, 20, 3).double(), torch.randn(2, 20, 8).double()
    shuffled = torch.randperm(20)
    assert Trait.PERMUTATION_EQUIVARIANT in backbone.traits
    refined = backbone(points, features)
    torch.testing.assert_close(backbone(points[:, shuffled], features[:, shuffled]), refined[:, shuffled])


def test_too_few_points_are_refused():
    DenseEdgeConv(3, 2, 3, 16)(torch.randn(1, 17, 3))
    with pytest.raises(UserError, match="17 neighbours were asked of 16 points"):
        DenseEdgeConv(3, 2, 3, 16)(torch.randn(1, 16, 3))
