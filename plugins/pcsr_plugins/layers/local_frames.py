"""The frame of each point's neighbourhood, and what in it does not depend on how the cloud is turned.

A neighbourhood is told by lengths and angles alone, as in point pair features (Drost et al., "Model Globally, Match
Locally", CVPR 2010, Eq. 1), here with the normal of the neighbourhood and in units of the spacing of its points. So a
network that reads these, and answers in the same frame, turns, moves and scales with its cloud by construction, and
what it learned of one place of a surface holds for all places that look alike.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Neighbours, Points
from pcsr_plugins.layers.spacing import mean_length

SCALARS = 8
"""Numbers that tell an edge."""


@dataclass(frozen=True)
class LocalFrames:
    """The neighbourhood of each point. Nothing here has a gradient."""

    near: Neighbours
    """The nearest other points, nearest first."""
    ways: Float[Tensor, "b n k 3"]
    """The ways to them, in units of `unit`."""
    unit: Float[Tensor, "b n 1"]
    """The spacing: mean distance to the nearest few."""
    normal: Float[Tensor, "b n 3"]
    """Of the plane that fits the neighbourhood best, on the side on which most of it lies."""
    rough: Float[Tensor, "b n 1"]
    """Root mean square of the neighbours' heights over that plane, in units of `unit`: 0 where all is flat."""

    @classmethod
    def of(cls, points: Points, neighbours: int) -> "LocalFrames":
        """Of each point and its nearest other ones; fewer where there are fewer.

        Raises:
            UserError: there is no other point.
        """
        with torch.no_grad():
            near = knn(points, points, min(neighbours + 1, max(2, points.shape[1])))[..., 1:]
            ways = gather(points, near) - points.unsqueeze(2)
            unit = mean_length(ways)
            ways = ways / unit.unsqueeze(2)
            normal = plane(ways)
            height = (ways * normal.unsqueeze(2)).sum(-1)
            side = torch.where(height.sum(-1, keepdim=True) < 0, -1.0, 1.0)
            rough = height.square().mean(-1, keepdim=True).sqrt()
            return cls(near, ways, unit, normal * side, rough)

    def around(self, spokes: int) -> Int[Tensor, "b n s"]:
        """For each point the columns of `near` that lie around it: the nearest of each of as many equal angles.

        So a way leads across each gap, where the nearest of all lie on this side of it. Height counts double, since
        what is high above the plane is on another sheet of the surface. The angles begin at the nearest point's. Where
        nobody lies within an angle, one of the nearest of all takes the place.
        """
        spokes = min(spokes, self.near.shape[2])
        height = (self.ways * self.normal.unsqueeze(2)).sum(-1)
        flat = self.ways - height.unsqueeze(-1) * self.normal.unsqueeze(2)
        first = flat[:, :, :1]
        turned = torch.cross(self.normal.unsqueeze(2), first, dim=-1)
        angle = torch.atan2((flat * turned).sum(-1), (flat * first).sum(-1))
        sector = torch.round(angle * spokes / (2 * math.pi)).long() % spokes  # (b n k)
        cost = self.ways.norm(dim=-1) + 2 * height.abs()
        within = sector.unsqueeze(2) == torch.arange(spokes, device=sector.device)[:, None]  # (b n s k)
        least, column = torch.where(within, cost.unsqueeze(2), math.inf).min(-1)
        empty = least.isinf()
        return torch.where(empty, (empty.cumsum(-1) - 1).clamp_min(0), column)

    def edges(self) -> Float[Tensor, "b n k 8"]:
        """What tells an edge: its length, its heights over both planes, their angle, and how both ends differ."""
        theirs = gather(self.normal, self.near)
        middle = self.ways.mean(2, keepdim=True)
        return torch.stack(
            [
                self.ways.norm(dim=-1),
                (self.ways * self.normal.unsqueeze(2)).sum(-1),
                (self.ways * theirs).sum(-1),
                (theirs * self.normal.unsqueeze(2)).sum(-1),
                (gather(self.unit, self.near) / self.unit.unsqueeze(2)).squeeze(-1).log().clamp(-3, 3),
                gather(self.rough, self.near).squeeze(-1) - self.rough,
                (self.ways * middle).sum(-1),
                (self.ways * gather(middle.squeeze(2), self.near)).sum(-1),
            ],
            dim=-1,
        )


def plane(ways: Float[Tensor, "b n k 3"]) -> Float[Tensor, "b n 3"]:
    """The normal of the plane through a point that fits its neighbours best, of either sign."""
    spread = ways - ways.mean(2, keepdim=True)
    # In double precision: of a flat neighbourhood the least eigenvalue is 0, and its direction must not be noise.
    spread = spread.double()
    normal: Tensor = torch.linalg.eigh(spread.mT @ spread).eigenvectors[..., 0]
    return normal.to(ways.dtype)
