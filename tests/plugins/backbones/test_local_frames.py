"""`frames`, the backbone: residual convolutions over frames."""

import pytest
import torch

from pcsr import Trait, Widths
from pcsr_plugins.backbones.local_frames import LocalFrameBackbone
from pcsr_plugins.encoders.local_frames import LocalFrameEncoder
from pcsr_plugins.layers.local_frames import LocalFrames
from tests.plugins.compare import close
from tests.plugins.slow_frames import curved


def test_gradients_reach_every_weight_and_the_features():
    points, features = curved(), torch.randn(2, 60, 8, dtype=torch.float64, requires_grad=True)
    backbone = LocalFrameBackbone(Widths(visual=8), layers=2).double()
    backbone(points, features).square().sum().backward()
    assert (features.grad != 0).any(2).all()
    for weight in backbone.parameters():
        assert weight.grad.isfinite().all()
        assert weight.grad.abs().max() > 0


@pytest.mark.parametrize("layers", [0, 1, 3])
@torch.no_grad()
def test_the_backbone_adds_to_the_features(layers):
    points, features = curved(), torch.randn(2, 60, 8, dtype=torch.float64)
    backbone = LocalFrameBackbone(Widths(visual=8), layers=layers).double()
    frames = LocalFrames.of(points, backbone.neighbours)
    expected = features
    for norm, conv, mlp in zip(backbone.norms, backbone.convolutions, backbone.mlps, strict=True):
        expected = expected + mlp(conv(norm(expected), frames, frames.edges))
    close(backbone(points, features), expected, 1e-9)
    assert backbone.channels == 8
    assert len(backbone.mlps) == layers


@torch.no_grad()
def test_only_what_is_near_is_heard():
    here, there = curved(0, 30), curved(1, 30)
    encoder, backbone = LocalFrameEncoder(Widths(), channels=8).double(), LocalFrameBackbone(Widths(visual=8)).double()

    def refined(points):
        return backbone(points, encoder(points))

    both, other = (refined(torch.cat([here, 9 + size * there], 1)) for size in (1, 0.1))
    close(both[:, :30], other[:, :30], 0)
    close(both[:, :30], refined(here), 1e-12)
    assert (refined(torch.cat([here, here + 0.01 * there], 1))[:, :30] - both[:, :30]).abs().max() > 1e-3


def test_channels_and_traits_are_as_claimed():
    backbone = LocalFrameBackbone(Widths(visual=24))
    assert backbone.channels == 24
    assert backbone.traits == {Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL}
