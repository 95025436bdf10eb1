"""Periodic shuffling and a coordinate MLP: TAPSR, Sec. 3.5, after PU-Transformer's tail.

(b n c) becomes (b r·n c/r), and "another MLP is applied to estimate the 3D coordinates". Both papers say
coordinates; `start: point` predicts the way from the input point instead, and `start: neighbours` the way from
places that lead to its neighbours, in units of the distance to them (PAPER.md, "Coordinates").
"""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.heads import zero_linear
from pcsr_plugins.layers.options import Channels

SPOKES = 8
"""Neighbours that new points start towards."""
FARTHEST = 0.4
"""The share of the way to them at which the outermost start."""


class Shuffle(Upsampler):
    """Cuts each point's channels into r pieces: one for each new point."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self, widths: Widths, *, hidden: Channels = 64, start: Literal["origin", "neighbours"] = "origin"
    ) -> None:
        super().__init__()
        self.rate = widths.rate
        self.start = start
        if widths.refined % widths.rate:
            raise UserError(
                f"upsampler 'shuffle' cuts the backbone's {widths.refined} channels into {widths.rate} equal pieces, "
                f"which leaves {widths.refined % widths.rate} over: choose a rate that divides {widths.refined}"
            )
        last = zero_linear(hidden, 3) if start == "neighbours" else nn.Linear(hidden, 3)
        self.mlp = nn.Sequential(nn.Linear(widths.refined // widths.rate, hidden), nn.ReLU(), last)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Shuffle and reconstruct."""
        if rate != self.rate:
            raise UserError(f"this 'shuffle' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        b, n, c = features.shape
        dense: Dense = self.mlp(features.reshape(b, n * rate, c // rate))
        if self.start == "origin":
            return dense
        places, spacing = neighbour_offsets(points, rate)
        return places + spacing.repeat_interleave(rate, dim=1) * dense


def neighbour_offsets(points: Points, rate: int) -> tuple[Dense, Float[Tensor, "b n 1"]]:
    """For each point `rate` places on the ways to its nearest neighbours, in rings: 0.4 and 0.2 of the way for 16.

    None goes half the way, so that two neighbours on their ways to each other don't meet.

    Returns:
        The places, and for each point the mean length of those ways: what "far" means there.
    """
    spokes = min(SPOKES, rate, points.shape[1] - 1)
    rings = -(-rate // spokes)
    shares = FARTHEST * (1 - torch.arange(rings, device=points.device) / rings)
    ways = gather(points, knn(points, points, spokes + 1)[..., 1:]) - points.unsqueeze(2)  # (b n spokes 3)
    places = points[:, :, None, None] + shares[:, None, None].to(points.dtype) * ways.unsqueeze(2)
    return places.flatten(2, 3)[:, :, :rate].flatten(1, 2), ways.norm(dim=-1).mean(-1, keepdim=True)
