"""Places on the ways from each point to its neighbours, moved in the frame of the edge, and thinned to be even.

Our own. Of the places that `shuffle` starts from there are twice as many as are wanted, and the host keeps those that
are farthest from each other: how evenly the new points lie weighs as much in every metric as how near they are to the
surface (docs/decisions.md). Each is moved along its edge and across it, in proportion to how unevenly the neighbours
lie, and along the normal, in proportion to how rough the neighbourhood is: an even cloud of a plane stays as it is.
What is read are lengths and angles, so one network serves every rate and every way that a cloud is turned. Before
training it moves nothing: the network *is* the interpolation.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, Widths
from pcsr.geometry.neighbours import gather
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.frames import SCALARS, Frames

FARTHEST = 0.45
"""The share of the way to a neighbour at which the outermost places lie: its own are on the other side of half."""
TINY = 1e-9
"""Keeps the direction of an edge of no length finite."""


class Fan(Upsampler):
    """Moves each place by an MLP of the edge that it lies on, in units of the spacing of the points there."""

    traits = frozenset({Trait.POINT_ORDER_FREE, Trait.ANY_RATE})

    def __init__(
        self, widths: Widths, *, hidden: int = 64, spokes: int = 8, surplus: float = 2.0, neighbours: int = 16
    ) -> None:
        """Choose how many places there are.

        Args:
            widths: of the features, from the host.
            hidden: of the MLP.
            spokes: neighbours of a point that places lead to.
            surplus: places for each point that is wanted.
            neighbours: of a point, which its frame is fitted to.
        """
        super().__init__()
        self.spokes, self.surplus, self.neighbours = spokes, surplus, neighbours
        self.here = nn.Linear(widths.refined, hidden)
        self.there = nn.Linear(widths.refined, hidden, bias=False)
        self.edge = nn.Linear(SCALARS, hidden, bias=False)
        self.share = nn.Linear(2, hidden, bias=False)
        last = nn.Linear(hidden, 3)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.mlp = nn.Sequential(nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), last)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Set places out and move them; `surplus`·rate·n of them, or a few more."""
        frames = Frames.of(points, self.neighbours)
        spokes = min(self.spokes, frames.near.shape[2])
        near, ways = frames.near[:, :, :spokes], frames.ways[:, :, :spokes]
        known = self.here(features).unsqueeze(2) + gather(self.there(features), near)  # (b n s hidden)
        known = known + self.edge(frames.edges()[:, :, :spokes])
        axes = _axes(ways, frames)
        rings = math.ceil(self.surplus * rate / spokes)
        made = []
        for ring in range(1, rings + 1):
            share = FARTHEST * ring / rings
            told = self.share(torch.tensor([share, share * share], dtype=points.dtype, device=points.device))
            moved = (self.mlp(known + told).unsqueeze(-1) * axes).sum(3)  # (b n s 3)
            made.append(points.unsqueeze(2) + frames.unit.unsqueeze(2) * (share * ways + moved))
        return torch.cat(made, dim=1).flatten(1, 2)


def _axes(ways: Float[Tensor, "b n s 3"], frames: Frames) -> Float[Tensor, "b n s axes 3"]:
    """The directions along each edge in the plane and across it, as long as neighbours lie unevenly, and up."""
    up = frames.normal.unsqueeze(2).expand_as(ways)
    along = F.normalize(ways - (ways * up).sum(-1, keepdim=True) * up, dim=-1, eps=TINY)
    across = torch.cross(up, along, dim=-1)
    uneven, rough = frames.lopsided.unsqueeze(2), frames.rough.unsqueeze(2)
    return torch.stack([uneven * along, uneven * across, rough * up], dim=3)
