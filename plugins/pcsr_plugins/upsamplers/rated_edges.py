"""Candidates along edges, displaced copies of the points themselves, and a predicted error of each. Our own.

The candidates are those of `edge-offsets`. Instead of each point itself there is a copy of it, displaced along its
normal: a cloud that was generated, or measured with noise, is corrected by the next pass. The predicted error is the
expected distance from the surface, as in the confidence of PU-Gaussian (Khater et al., ICCV Workshops 2025); the choice
among candidates weighs it (`pcsr.upsample.selection`). Zero-initialised: before training points stay where they are.
"""

from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Widths
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.edge_candidates import EdgeCandidates, Spokes, Surplus
from pcsr_plugins.layers.heads import displacement_head, zero_linear
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.layers.options import Channels, NeighbourCount

BIAS = -3.0
"""Added to predicted errors before the softplus: an untrained network expects 0.05 local spacings."""


class RatedEdges(EdgeCandidates):
    """Displaces points and candidates on their edges, and predicts the distance of each from the surface."""

    corrects_points: ClassVar[bool] = True

    def __init__(
        self,
        widths: Widths,
        *,
        hidden: Channels = 64,
        spokes: Spokes = 8,
        surplus: Surplus = 2.0,
        neighbours: NeighbourCount = 16,
    ) -> None:
        """Choose how many candidates there are. Arguments are those of `EdgeCandidates`."""
        super().__init__(widths, hidden=hidden, spokes=spokes, surplus=surplus, neighbours=neighbours)
        self.own = nn.Sequential(nn.Linear(widths.refined, hidden), displacement_head(hidden, 2))
        self.error = zero_linear(hidden, 1)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """A displaced copy of each point, and `surplus`·rate·n candidates, or a few more."""
        return self.with_errors(points, features, rate)[0]

    def with_errors(self, points: Points, features: Features, rate: int) -> tuple[Dense, Float[Tensor, "b dense"]]:
        """Generate the points of `forward`, and predict their distances from the surface in the unit of `points`."""
        frames = LocalFrames.of(points, self.neighbours)
        height, error = self.own(features).split(1, dim=-1)
        clouds = [(points + frames.unit * frames.rough * height * frames.normal).unsqueeze(2)]
        errors = [error]
        for candidates, hidden in self.rings(frames, points, features, rate):
            clouds.append(candidates)
            errors.append(self.error(hidden).squeeze(-1))
        expected = frames.unit * F.softplus(torch.cat(errors, dim=2) + BIAS)
        return torch.cat(clouds, dim=2).flatten(1, 2), expected.flatten(1)
