"""`frames`, the encoder: one convolution of nothing but the frames."""

import torch

from pcsr import Trait, Widths
from pcsr_plugins.encoders.local_frames import LocalFrameEncoder
from pcsr_plugins.layers.local_frames import LocalFrames
from tests.plugins.slow_frames import curved


def test_gradients_reach_every_weight():
    encoder = LocalFrameEncoder(Widths()).double()
    encoder(curved()).square().sum().backward()
    for weight in encoder.parameters():
        assert weight.grad.isfinite().all()
        assert weight.grad.abs().max() > 0


def test_channels_are_those_asked_for_and_traits_as_claimed():
    encoder = LocalFrameEncoder(Widths(), channels=24)
    assert encoder(curved().float()).shape == (2, 60, 24)
    assert encoder.channels == 24
    assert encoder.traits == {Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL}


@torch.no_grad()
def test_it_is_one_convolution_of_how_rough_each_neighbourhood_is():
    encoder, frames = LocalFrameEncoder(Widths(), channels=7, neighbours=6).double(), LocalFrames.of(curved(), 6)
    expected = torch.relu(encoder.layer(frames.rough, frames, frames.edges))
    torch.testing.assert_close(encoder(curved()), expected)
