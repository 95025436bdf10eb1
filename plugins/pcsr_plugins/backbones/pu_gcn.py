"""The Inception DenseGCN blocks of PU-GCN.

Qian et al., "PU-GCN: Point Cloud Upsampling using Graph Convolutional Networks", CVPR 2021, in the
reading of its published code, quirks included:

- the outputs of the blocks are averaged;
- of a dense path's three layers the second is applied twice, with the same weights;
- the third branch is the greatest of each point's own channels, a single number, not a maximum over neighbours.

So the weights are as many as published. They start as torch's layers do, not by Xavier's rule.
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Backbone, Trait, Widths
from pcsr.geometry.neighbours import gather
from pcsr.tensors import Features, Neighbours, Points
from pcsr_plugins.layers.edge_conv import EdgeConv, graph
from pcsr_plugins.layers.options import Channels, Layers, NeighbourCount

LAYERS = 3
"""Of a dense path."""


class PUGCN(Backbone):
    """Blocks in a row; the mean of what they give."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        blocks: Layers = 2,
        growth: Channels = 32,
        neighbours: NeighbourCount = 20,
        dilation: Annotated[int, Field(ge=1, le=16)] = 2,
    ) -> None:
        super().__init__()
        self.channels = 2 * LAYERS * growth + 1
        wide = (widths.visual, *[self.channels] * (blocks - 1))
        self.blocks = nn.ModuleList(Inception(c_in, growth, neighbours, dilation) for c_in in wide)

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """Refine the features; the coordinates aren't asked again."""
        given = []
        for block in self.blocks:
            features = block(features)
            given.append(features)
        return torch.stack(given).mean(0)


class Inception(nn.Module):
    """Two dense paths on one graph, of the nearest points and of every other one of twice as many, and a shortcut.

    The graph is that of the features which the block is given, so it changes from block to block. Where it gives as
    many channels as it is given it adds them.
    """

    def __init__(self, c_in: int, growth: int, neighbours: int, dilation: int) -> None:
        super().__init__()
        self.neighbours = neighbours
        self.dilation = dilation
        self.reduce = nn.Linear(c_in, growth)
        self.near = DensePath(growth)
        self.far = DensePath(growth)

    def forward(self, x: Features) -> Float[Tensor, "b n refined"]:
        """The branches side by side.

        Raises:
            UserError: there are no more points than `dilation` times the neighbours.
        """
        index = graph(x, self.neighbours * self.dilation)
        reduced = F.relu(self.reduce(x))
        branches = [
            self.near(reduced, index[..., : self.neighbours]),
            self.far(reduced, index[..., :: self.dilation]),
            x.amax(-1, keepdim=True),
        ]
        given = torch.cat(branches, dim=-1)
        return given + x if given.shape == x.shape else given


class DensePath(nn.Module):
    """A dense net on the edges.

    The maximum over each point's edges goes on, of all three layers::

        y₁ = ReLU(W₁·(xⱼ − xᵢ) + b₁ + W₂·xᵢ)
        y₂ = f(f(y₁)), where f(y) = ReLU(W₃·y + b₃)
        y₃ = ReLU(W₄·[y₁, y₂] + b₄)
    """

    def __init__(self, growth: int) -> None:
        super().__init__()
        self.edge = EdgeConv(growth, growth)
        self.twice = nn.Linear(growth, growth)
        self.last = nn.Linear(2 * growth, growth)

    def forward(self, x: Features, index: Neighbours) -> Float[Tensor, "b n dense"]:
        """The maximum of [y₁, y₂, y₃]."""
        first = F.relu(self.edge.at_centre(x).unsqueeze(2) + gather(self.edge.at_neighbour(x), index))  # (b n k growth)
        second = F.relu(self.twice(F.relu(self.twice(first))))
        third = F.relu(self.last(torch.cat([first, second], dim=-1)))
        return torch.cat([y.amax(2) for y in (first, second, third)], dim=-1)
