"""The set abstraction of PointNet++: a small PointNet on the ball around each centre.

Qi et al., "PointNet++: Deep Hierarchical Feature Learning on Point Sets in a Metric Space", NeurIPS 2017, Sec. 3.2::

    f'(c) = max over j in the ball of c of MLP([pⱼ − c, fⱼ])

The ball holds the `samples` nearest of the points within `radius`; the code of PointNet++ takes those that come first
in the file. It fills up the ball with copies of one of them, which leave the maximum as it is.
"""

from itertools import pairwise

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Points


class SetAbstraction(nn.Module):
    """The block of the module's docstring; a centre without points in its ball takes the nearest one."""

    def __init__(self, c_in: int, channels: tuple[int, ...], radius: float, samples: int) -> None:
        super().__init__()
        self.channels = channels[-1]
        self.radius = radius
        self.samples = samples
        self.first = nn.Linear(3 + c_in, channels[0])
        self.others = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(channels))

    def forward(
        self, centres: Float[Tensor, "b q 3"], points: Points, features: Features | None
    ) -> Float[Tensor, "b q wide"]:
        """Features of each ball.

        Args:
            centres: the middles of the balls, as a rule some of the points.
            points: (b n 3).
            features: (b n c) of the points; None where there are coordinates alone.
        """
        index = ball(centres, points, self.radius, self.samples)
        # The first layer is linear in pⱼ, c and fⱼ: it is worked out for each point and each centre, not each edge.
        known = points if features is None else torch.cat([points, features], dim=-1)
        own = F.linear(centres, self.first.weight[:, :3])
        y = gather(self.first(known), index) - own.unsqueeze(2)  # (b q k wide)
        for layer in self.others:
            y = layer(F.relu(y))
        return F.relu(y.amax(2))


def ball(centres: Float[Tensor, "b q 3"], points: Points, radius: float, samples: int) -> Int[Tensor, "b q k"]:
    """Indices of the nearest points within `radius` of each centre, at most `samples`, filled up by the nearest.

    k is the most that any of the balls holds: of patches of 256 points those of PU-Net hold but a few.
    """
    index = knn(centres, points, min(samples, points.shape[1]))
    with torch.no_grad():
        inside = (gather(points, index) - centres.unsqueeze(2)).square().sum(-1) < radius**2
        most = max(1, int(inside.sum(-1).max()))
        return torch.where(inside, index, index[..., :1])[..., :most]
