"""The head of PU-Transformer: one layer on each point's coordinates.

Qiu et al., "PU-Transformer: Point Cloud Upsampling Transformer", ACCV 2022: a single MLP, 3 → 16. The choice
that leaves the FE block of TAPSR out (TAPSR, Table 4, first row).
"""

from torch import nn

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points


class Mlp(Encoder):
    """Each point for itself."""

    traits = frozenset({Trait.POINT_ORDER_FREE})

    def __init__(self, widths: Widths, *, channels: int = 16) -> None:
        super().__init__()
        self.channels = channels
        self.layer = nn.Sequential(nn.Linear(3, channels), nn.ReLU())

    def forward(self, points: Points) -> Features:
        """Lift each point's coordinates."""
        features: Features = self.layer(points)
        return features
