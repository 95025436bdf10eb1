"""Dis-PU's two steps: a coarse dense cloud, then a refiner that moves each of its points.

Li et al., "Point Cloud Upsampling via Disentangled Refinement", CVPR 2021, Sec. 3; the refiner's details, which the
paper leaves open, are those of its code: a local and a global unit after PointASNL (Yan et al., CVPR 2020), whose local
one is a PointConv (Wu et al., CVPR 2019). The coarse cloud holds coordinates themselves; the refiner's offset
from there is at most `reach` along each axis.
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.geometry.neighbours import gather, knn, neighbour_max
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.grid import grid
from pcsr_plugins.layers.options import Positive

HIDDEN = (256, 64)
"""Channels before the coordinates, of the coarse cloud and of the offsets."""


class DisPU(Upsampler):
    """Both clouds come out of `stages`; the result is the refined one."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})
    grid: Tensor

    def __init__(
        self,
        widths: Widths,
        *,
        channels: Annotated[int, Field(ge=2, le=512)] = 128,
        neighbours: Annotated[int, Field(ge=1, le=64)] = 16,
        reach: Positive = 0.5,
    ) -> None:
        super().__init__()
        self.rate = widths.rate
        self.reach = reach
        self.register_buffer("grid", grid(widths.rate), persistent=False)
        self.copy = nn.Linear(widths.refined + 2, 2 * channels)
        self.expand = nn.Linear(2 * channels, channels)
        self.coarse = _regressor(channels)
        self.refiner = Refiner(channels, neighbours)
        self.way = _regressor(self.refiner.channels)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """The refined cloud."""
        return self.stages(points, features, rate)[-1]

    def stages(self, points: Points, features: Features, rate: int) -> list[Dense]:
        """The coarse cloud and the refined one."""
        if rate != self.rate:
            raise UserError(f"this 'dis-pu' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        # The first layer on [feature, grid point]: the wide part is the same for all copies of a point.
        own, code = torch.split(self.copy.weight, [features.shape[-1], 2], dim=1)
        copies = F.linear(features, own, self.copy.bias).unsqueeze(2) + F.linear(self.grid.to(features.dtype), code)
        dense = F.relu(self.expand(F.relu(copies))).flatten(1, 2)  # (b r·n c)
        coarse: Dense = self.coarse(dense)
        offset = self.reach * (2 * torch.sigmoid(self.way(self.refiner(coarse, dense))) - 1)
        return [coarse, coarse + offset]


class Refiner(nn.Module):
    """Local and global unit: messages of the nearest neighbours, and attention over all points; twice the channels.

    Inputs of a neighbour j are its offset xⱼ − xᵢ, its coordinates xⱼ and its feature fⱼ, in this order::

        local  = ReLU(W·Σⱼ hⱼ ⊗ kⱼ),  hⱼ = MLP(xⱼ − xᵢ, xⱼ, fⱼ),  kⱼ = ReLU(Norm(K·(xⱼ − xᵢ)))
        skip   = ReLU(W·max over j of (xⱼ − xᵢ, xⱼ, fⱼ))
        global = ReLU(W·softmax(q·kᵀ/√c)·v)

    Norm is a batch norm in the code. Here each object of a batch is normalised by itself, which has as many weights,
    keeps objects independent, and does the same in training as afterwards.
    """

    def __init__(self, channels: int, neighbours: int) -> None:
        super().__init__()
        self.channels = 2 * channels
        self.neighbours = neighbours
        wide = 3 + 3 + channels
        self.edge = nn.Linear(wide, channels)
        self.edge_again = nn.Linear(channels, channels)
        self.kernel = nn.Linear(3, neighbours)
        self.norm = nn.GroupNorm(neighbours, neighbours)  # each channel by itself
        self.local = nn.Linear(channels * neighbours, self.channels)
        self.skip = nn.Linear(wide, self.channels)
        self.query = nn.Linear(channels, channels // 2)
        self.key = nn.Linear(channels, channels // 2)
        self.value = nn.Linear(channels, channels // 2)
        self.back = nn.Linear(channels // 2, self.channels)
        self.merge = nn.Linear(self.channels, self.channels)

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n wide"]:
        """Features of each point of the coarse cloud, from which its offset is predicted."""
        index = knn(points.detach(), points.detach(), self.neighbours)  # each point is its own first neighbour
        placed = torch.cat([points, features], dim=-1)
        top = neighbour_max(placed, index)
        skip = F.relu(self.skip(torch.cat([top[..., :3] - points, top], dim=-1)))

        # The first edge layer is linear in what belongs to j and what belongs to i: a point at a time.
        offset, rest = torch.split(self.edge.weight, [3, placed.shape[-1]], dim=1)
        there = F.linear(placed, rest) + F.linear(points, offset)
        here = self.edge.bias - F.linear(points, offset)
        messages = F.relu(self.edge_again(F.relu(gather(there, index) + here.unsqueeze(2))))  # (b n k c)
        offsets = gather(points, index) - points.unsqueeze(2)
        kernel = F.relu(self.norm(self.kernel(offsets).movedim(-1, 1)).movedim(1, -1))  # (b n k k)
        local = F.relu(self.local((messages.transpose(2, 3) @ kernel).flatten(2)))

        q, k, v = (layer(features).unsqueeze(1) for layer in (self.query, self.key, self.value))
        attended = F.relu(self.back(F.scaled_dot_product_attention(q, k, v).squeeze(1)))
        result: Tensor = F.relu(self.merge(local + skip + attended))
        return result


def _regressor(c_in: int) -> nn.Sequential:
    wide, narrow = HIDDEN
    return nn.Sequential(nn.Linear(c_in, wide), nn.ReLU(), nn.Linear(wide, narrow), nn.ReLU(), nn.Linear(narrow, 3))
