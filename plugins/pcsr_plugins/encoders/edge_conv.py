"""The head of PU-GCN: one edge convolution on the coordinates.

Qian et al., "PU-GCN", CVPR 2021, in the reading of its published code: the graph of the 20
nearest points in space, 3 → 32 channels.
"""

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.edge_conv import EdgeConv as Layer
from pcsr_plugins.layers.edge_conv import graph
from pcsr_plugins.layers.options import Channels, NeighbourCount


class EdgeConv(Encoder):
    """One edge convolution on the offsets to each point's neighbours."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, channels: Channels = 32, neighbours: NeighbourCount = 20) -> None:
        super().__init__()
        self.channels = channels
        self.neighbours = neighbours
        self.layer = Layer(3, channels)

    def forward(self, points: Points) -> Features:
        """Encode each point's neighbourhood."""
        features: Features = self.layer(points, graph(points, self.neighbours))
        return features
