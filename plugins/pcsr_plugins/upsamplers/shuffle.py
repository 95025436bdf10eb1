"""Periodic shuffling and a coordinate MLP: TAPSR, Sec. 3.5, after PU-Transformer's tail.

(b n c) becomes (b r·n c/r), and "another MLP is applied to estimate the 3D coordinates". Both papers predict
coordinates; `start: neighbours` predicts offsets from points on the edges to the neighbours, in units of the edges'
mean length (PAPER.md, "Coordinates").
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
"""Neighbours on the edges to which new points start."""
FARTHEST = 0.4
"""Share of the edge at which the outermost start."""


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
        starts, spacing = neighbour_offsets(points, rate)
        return starts + spacing.repeat_interleave(rate, dim=1) * dense


def neighbour_offsets(points: Points, rate: int) -> tuple[Dense, Float[Tensor, "b n 1"]]:
    """`rate` points on the edges from each point to its neighbours, in rings: at 0.4 and 0.2 of the edge for 16.

    All are closer than half of the edge, so that those of two neighbours do not coincide.

    Returns:
        The points, and for each input point the mean length of its edges.
    """
    spokes = min(SPOKES, rate, points.shape[1] - 1)
    rings = -(-rate // spokes)
    shares = FARTHEST * (1 - torch.arange(rings, device=points.device) / rings)
    offsets = gather(points, knn(points, points, spokes + 1)[..., 1:]) - points.unsqueeze(2)  # (b n spokes 3)
    starts = points[:, :, None, None] + shares[:, None, None].to(points.dtype) * offsets.unsqueeze(2)
    return starts.flatten(2, 3)[:, :, :rate].flatten(1, 2), offsets.norm(dim=-1).mean(-1, keepdim=True)
