"""The first layer of 3PU, PU-GAN and Dis-PU: one linear layer on each point's coordinates, without activation.

Wang et al., "Patch-based Progressive 3D Point Set Upsampling" (3PU), CVPR 2019, and those whose code goes back to its:
3 → 24. The layers after it look for neighbours among these features, which are no more than the coordinates in a
space of 24 dimensions.
"""

from torch import nn

from pcsr import Encoder, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.options import Channels


class Linear(Encoder):
    """Each point for itself."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, channels: Channels = 24) -> None:
        super().__init__()
        self.channels = channels
        self.layer = nn.Linear(3, channels)

    def forward(self, points: Points) -> Features:
        """Lift each point's coordinates."""
        features: Features = self.layer(points)
        return features
