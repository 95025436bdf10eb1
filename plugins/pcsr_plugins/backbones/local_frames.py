"""Residual convolutions over local reference frames. Our own.

The receptive field is local: the surface between points follows from the few around them, and a part of a scan has the
same features as the same part of a whole object.
"""

from torch import nn

from pcsr import Backbone, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.layers.options import Layers, NeighbourCount


class LocalFrameBackbone(Backbone):
    """f ← f + MLP(LocalFrameConv(Norm(f))), again and again, on one graph."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL})

    def __init__(self, widths: Widths, *, layers: Layers = 4, neighbours: NeighbourCount = 16) -> None:
        super().__init__()
        self.channels = c = widths.visual
        self.neighbours = neighbours
        self.norms = nn.ModuleList(nn.LayerNorm(c) for _ in range(layers))
        self.convolutions = nn.ModuleList(LocalFrameConv(c, c) for _ in range(layers))
        self.mlps = nn.ModuleList(nn.Sequential(nn.ReLU(), nn.Linear(c, c)) for _ in range(layers))

    def forward(self, points: Points, features: Features) -> Features:
        """Refine the features."""
        frames = LocalFrames.of(points, self.neighbours)
        edges = frames.edges
        for norm, convolution, mlp in zip(self.norms, self.convolutions, self.mlps, strict=True):
            features = features + mlp(convolution(norm(features), frames, edges))
        return features
