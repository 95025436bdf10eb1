"""Rotation-invariant features of each point's neighbourhood, from lengths and angles in its local frame. Our own."""

import torch

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.layers.options import Channels, NeighbourCount


class LocalFrameEncoder(Encoder):
    """One edge convolution on the local reference frames."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL})

    def __init__(self, widths: Widths, *, channels: Channels = 64, neighbours: NeighbourCount = 16) -> None:
        super().__init__()
        self.channels = channels
        self.neighbours = neighbours
        self.layer = LocalFrameConv(1, channels)

    def forward(self, points: Points) -> Features:
        """Encode each point's neighbourhood."""
        frames = LocalFrames.of(points, self.neighbours)
        features: Features = self.layer(frames.rough, frames, frames.edges)
        return torch.relu(features)
