"""The neighbourhood of each point by lengths and angles, whatever way the cloud is turned. Our own."""

import torch

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.layers.options import Channels, NeighbourCount


class LocalFrameEncoder(Encoder):
    """One convolution, of nothing but the frames."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, channels: Channels = 64, neighbours: NeighbourCount = 16) -> None:
        super().__init__()
        self.channels = channels
        self.neighbours = neighbours
        self.layer = LocalFrameConv(1, channels)

    def forward(self, points: Points) -> Features:
        """Encode each point's neighbourhood."""
        frames = LocalFrames.of(points, self.neighbours)
        features: Features = self.layer(frames.rough, frames, frames.edges())
        return torch.relu(features)
