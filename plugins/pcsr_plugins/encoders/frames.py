"""The neighbourhood of each point by lengths and angles, whatever way the cloud is turned. Our own."""

import torch

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.frame_conv import FrameConv
from pcsr_plugins.layers.frames import Frames
from pcsr_plugins.layers.options import Channels, NeighbourCount


class FrameEncoder(Encoder):
    """One convolution, of nothing but the frames."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, channels: Channels = 64, neighbours: NeighbourCount = 16) -> None:
        super().__init__()
        self.channels = channels
        self.neighbours = neighbours
        self.layer = FrameConv(1, channels)

    def forward(self, points: Points) -> Features:
        """Encode each point's neighbourhood."""
        frames = Frames.of(points, self.neighbours)
        features: Features = self.layer(frames.rough, frames, frames.edges())
        return torch.relu(features)
