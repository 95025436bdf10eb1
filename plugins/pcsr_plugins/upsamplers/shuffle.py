"""Periodic shuffling and a coordinate MLP: TAPSR, Sec. 3.5, after PU-Transformer's tail.

(b n c) becomes (b r·n c/r), and "another MLP is applied to estimate the 3D coordinates". Both papers say
coordinates; `start: point` predicts the way from the input point instead (PAPER.md, "Coordinates").
"""

from typing import Literal

from torch import nn

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.tensors import Dense, Features, Points


class Shuffle(Upsampler):
    """Cuts each point's channels into r pieces: one for each new point."""

    traits = frozenset({Trait.POINT_ORDER_FREE})

    def __init__(self, widths: Widths, *, hidden: int = 64, start: Literal["origin", "point"] = "origin") -> None:
        super().__init__()
        self.rate = widths.rate
        self.start = start
        if widths.refined % widths.rate:
            raise UserError(
                f"upsampler 'shuffle' cuts the backbone's {widths.refined} channels into {widths.rate} equal pieces, "
                f"which leaves {widths.refined % widths.rate} over: choose a rate that divides {widths.refined}"
            )
        self.mlp = nn.Sequential(nn.Linear(widths.refined // widths.rate, hidden), nn.ReLU(), nn.Linear(hidden, 3))

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Shuffle and reconstruct."""
        if rate != self.rate:
            raise UserError(f"this 'shuffle' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        b, n, c = features.shape
        dense: Dense = self.mlp(features.reshape(b, n * rate, c // rate))
        return dense if self.start == "origin" else dense + points.repeat_interleave(rate, dim=1)
