"""NodeShuffle, the upsampler of PU-GCN.

Qian et al., "PU-GCN", CVPR 2021, in the reading of its published code: an edge convolution widens
each point's features r times, on the graph of the 20 nearest points in space; a periodic shuffle cuts them into r
points; an MLP predicts the offset of each from the input point.
"""

from typing import Annotated

from pydantic import Field
from torch import nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.edge_conv import EdgeConv, graph
from pcsr_plugins.layers.options import Channels, NeighbourCount


class NodeShuffle(Upsampler):
    """Widens each point's channels by its neighbours, then cuts them into r pieces: one for each new point."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        channels: Annotated[int, Field(ge=1, le=512)] = 64,
        hidden: Channels = 32,
        neighbours: NeighbourCount = 20,
    ) -> None:
        super().__init__()
        self.rate = widths.rate
        self.neighbours = neighbours
        self.reduce = nn.Linear(widths.refined, channels)
        self.widen = EdgeConv(channels, channels * widths.rate)
        self.coordinates = nn.Sequential(nn.Linear(channels, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, 3))

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Widen, shuffle and reconstruct."""
        if rate != self.rate:
            raise UserError(
                f"this 'node-shuffle' was built for rate {self.rate}, not {rate}: train one for rate {rate}"
            )
        b, n, _ = features.shape
        wide = self.widen(F.relu(self.reduce(features)), graph(points, self.neighbours))
        offsets: Dense = self.coordinates(wide.reshape(b, n * rate, -1))
        return points.repeat_interleave(rate, dim=1) + offsets
