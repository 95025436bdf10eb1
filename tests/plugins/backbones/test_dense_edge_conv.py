"""`dense-edge-conv`: blocks of dense edge convolutions, each seeing all that came before."""

import torch
from torch.nn import functional as F

from pcsr import Trait, Widths
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs


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
