"""The first level of PU-Net: a small PointNet on the ball around each point.

Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, with the sizes of its code: radius 0.05 of a
patch's, 32 points, layers of 32, 32 and 64 channels, no batch norm. Every point is a centre. The levels above are the
backbone `pu-net`.
"""

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.options import Cascade, Count, Positive
from pcsr_plugins.layers.set_abstraction import SetAbstraction


class BallEncoder(Encoder):
    """Each point sees what lies around it."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self, widths: Widths, *, channels: Cascade = (32, 32, 64), radius: Positive = 0.05, samples: Count = 32
    ) -> None:
        super().__init__()
        self.channels = channels[-1]
        self.level = SetAbstraction(0, channels, radius, samples)

    def forward(self, points: Points) -> Features:
        """Encode the ball around each point."""
        features: Features = self.level(points, points, None)
        return features
