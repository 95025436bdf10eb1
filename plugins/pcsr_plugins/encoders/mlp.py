"""One layer on each point's coordinates: the head of PU-Transformer and Grad-PU.

Qiu et al., "PU-Transformer: Point Cloud Upsampling Transformer", ACCV 2022: a single MLP, 3 → 16. The choice
that leaves the FE block of TAPSR out (TAPSR, Table 4, first row). He et al., "Grad-PU", CVPR 2023: 3 → 32 with a
batch norm (`norm: batch`).
"""

from typing import Literal

from torch import nn

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.linear_norm_relu import LinearNormReLU
from pcsr_plugins.layers.options import Channels


class Mlp(Encoder):
    """Each point for itself."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, channels: Channels = 16, norm: Literal["none", "batch"] = "none") -> None:
        super().__init__()
        self.channels = channels
        self.layer = (
            LinearNormReLU(3, channels) if norm == "batch" else nn.Sequential(nn.Linear(3, channels), nn.ReLU())
        )

    def forward(self, points: Points) -> Features:
        """Lift each point's coordinates."""
        features: Features = self.layer(points)
        return features
