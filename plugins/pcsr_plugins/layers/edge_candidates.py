"""Candidates along the edges to neighbours, as the upsamplers `edge-offsets` and `rated-edges` generate them."""

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar

import torch
from jaxtyping import Float, Int, Shaped
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, Widths
from pcsr.geometry.neighbours import gather
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.heads import displacement_head
from pcsr_plugins.layers.local_frames import SCALARS, LocalFrames
from pcsr_plugins.layers.options import Channels, NeighbourCount

Spokes = Annotated[int, Field(ge=1, le=64)]
Surplus = Annotated[float, Field(ge=1, le=64)]

FARTHEST = 0.45
"""Share of the edge at which the outermost candidates start: those of the neighbour are beyond half."""


class EdgeCandidates(Upsampler):
    """Base class of upsamplers that displace candidates on edges by an MLP on the features of the edge.

    Offsets are in units of the local spacing.
    """

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE, Trait.LOCAL})
    max_rate_per_pass: ClassVar[int | None] = 8

    def __init__(
        self,
        widths: Widths,
        *,
        hidden: Channels = 64,
        spokes: Spokes = 8,
        surplus: Surplus = 2.0,
        neighbours: NeighbourCount = 16,
    ) -> None:
        """Choose how many candidates there are.

        Args:
            widths: of the features, from the host.
            hidden: of the MLP.
            spokes: edges of each point that candidates lie on.
            surplus: candidates for each point that is wanted.
            neighbours: of a point, which its frame is fitted to and spokes are chosen from.
        """
        super().__init__()
        self.spokes, self.surplus, self.neighbours = spokes, surplus, neighbours
        self.here = nn.Linear(widths.refined, hidden)
        self.there = nn.Linear(widths.refined, hidden, bias=False)
        self.edge = nn.Linear(SCALARS, hidden, bias=False)
        self.share = nn.Linear(2, hidden, bias=False)
        self.mlp = displacement_head(hidden, 2)

    def rings(
        self, frames: LocalFrames, points: Points, features: Features, rate: int
    ) -> Iterator[tuple[Float[Tensor, "b n s 3"], Float[Tensor, "b n s hidden"]]]:
        """Generate the candidates of each ring around the points, innermost first, and the MLP's last hidden layer."""
        around = frames.around(self.spokes)
        index, offsets, edges = (_chosen(each, around) for each in (frames.index, frames.offsets, frames.edges))
        known = self.here(features).unsqueeze(2) + gather(self.there(features), index) + self.edge(edges)
        up, neighbour_normals = frames.normal.unsqueeze(2), gather(frames.normal, index)
        unit, rough = frames.unit.unsqueeze(2), frames.rough.unsqueeze(2)
        rings = math.ceil(self.surplus * rate / around.shape[2])
        for ring in range(1, rings + 1):
            share = FARTHEST * ring / rings
            step = self.share(torch.tensor([share, share * share], dtype=points.dtype, device=points.device))
            # As a surface bends, so does its normal: around a thin limb the middle of an edge is pushed aside, not up.
            normal = F.normalize(torch.lerp(up, neighbour_normals, share), dim=-1)
            hidden = self.mlp[:-1](known + step)
            height, reach = (rough * self.mlp[-1](hidden)).split(1, dim=-1)
            along = share * 2 * torch.sigmoid(reach)  # an untrained one goes all of its share
            yield points.unsqueeze(2) + unit * (along * offsets + height * normal), hidden


def _chosen(of_edges: Shaped[Tensor, "b n k *c"], columns: Int[Tensor, "b n s"]) -> Shaped[Tensor, "b n s *c"]:
    """Some edges of each point."""
    index = columns.view(*columns.shape, *[1] * (of_edges.dim() - 3)).expand(*columns.shape, *of_edges.shape[3:])
    return of_edges.gather(2, index)
