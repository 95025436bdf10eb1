"""Places on the ways from each point to those around it, moved along the normal, and thinned to be even.

Our own. There are twice as many places as are wanted, and the host keeps those that are farthest from each other: how
evenly the new points lie weighs as much in every metric as how near they are to the surface (docs/decisions.md). Each
is moved along the normal there, and goes its way less far, or up to twice as far: less where that leads off the
surface, from one sheet of a thin limb to the other. Both are in proportion to how rough its point's neighbourhood is:
what is flat stays flat, and what is even stays even. What is read are lengths and angles, so one network serves every
rate and every way that a cloud is turned. Before training it moves nothing: the network *is* the interpolation.
"""

import math
from typing import Annotated, ClassVar

import torch
from jaxtyping import Int, Shaped
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, Widths
from pcsr.geometry.neighbours import gather
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.heads import displacement_head
from pcsr_plugins.layers.local_frames import SCALARS, LocalFrames
from pcsr_plugins.layers.options import Channels, NeighbourCount

FARTHEST = 0.45
"""The share of the way at which the outermost places of an untrained one lie: the neighbour's are beyond half."""


class EdgeOffsets(Upsampler):
    """Moves each place by what an MLP makes of the edge that it lies on, in units of the spacing there."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE})
    max_rate_per_pass: ClassVar[int | None] = 8

    def __init__(
        self,
        widths: Widths,
        *,
        hidden: Channels = 64,
        spokes: Annotated[int, Field(ge=1, le=64)] = 8,
        surplus: Annotated[float, Field(ge=1, le=64)] = 2.0,
        neighbours: NeighbourCount = 16,
    ) -> None:
        """Choose how many places there are.

        Args:
            widths: of the features, from the host.
            hidden: of the MLP.
            spokes: points around each that places lead to.
            surplus: places for each point that is wanted.
            neighbours: of a point, which its frame is fitted to and spokes are chosen from.
        """
        super().__init__()
        self.spokes, self.surplus, self.neighbours = spokes, surplus, neighbours
        self.here = nn.Linear(widths.refined, hidden)
        self.there = nn.Linear(widths.refined, hidden, bias=False)
        self.edge = nn.Linear(SCALARS, hidden, bias=False)
        self.share = nn.Linear(2, hidden, bias=False)
        self.mlp = displacement_head(hidden, 2)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Set places out and move them: the points themselves, which stay, and `surplus`·rate·n more, or a few more."""
        frames = LocalFrames.of(points, self.neighbours)
        around = frames.around(self.spokes)
        near, ways, edges = (_chosen(each, around) for each in (frames.near, frames.ways, frames.edges()))
        known = self.here(features).unsqueeze(2) + gather(self.there(features), near) + self.edge(edges)
        up, theirs = frames.normal.unsqueeze(2), gather(frames.normal, near)
        unit, rough = frames.unit.unsqueeze(2), frames.rough.unsqueeze(2)
        rings = math.ceil(self.surplus * rate / around.shape[2])
        made = [points.unsqueeze(2)]
        for ring in range(1, rings + 1):
            share = FARTHEST * ring / rings
            told = self.share(torch.tensor([share, share * share], dtype=points.dtype, device=points.device))
            # As a surface bends, so does its normal: around a thin limb the middle of a way is pushed aside, not up.
            normal = F.normalize(torch.lerp(up, theirs, share), dim=-1)
            height, reach = (rough * self.mlp(known + told)).split(1, dim=-1)
            along = share * 2 * torch.sigmoid(reach)  # an untrained one goes all of its share
            made.append(points.unsqueeze(2) + unit * (along * ways + height * normal))
        return torch.cat(made, dim=2).flatten(1, 2)


def _chosen(of_edges: Shaped[Tensor, "b n k *c"], columns: Int[Tensor, "b n s"]) -> Shaped[Tensor, "b n s *c"]:
    """Some edges of each point."""
    index = columns.view(*columns.shape, *[1] * (of_edges.dim() - 3)).expand(*columns.shape, *of_edges.shape[3:])
    return of_edges.gather(2, index)
