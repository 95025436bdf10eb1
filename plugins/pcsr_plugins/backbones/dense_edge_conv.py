"""The feature extraction of PU-GAN and Dis-PU: dense edge convolutions in a row, each of which sees all before it.

Li et al., "PU-GAN: a Point Cloud Upsampling Adversarial Network", ICCV 2019, Sec. 3.2, after Wang et al., "Patch-based
Progressive 3D Point Set Upsampling" (3PU), CVPR 2019; Li et al., "Point Cloud Upsampling via Disentangled
Refinement" (Dis-PU), CVPR 2021, takes it over as it is. At the published widths its 24 input channels become 120, 240,
360 and 480.
"""

from pcsr import Backbone, Trait, Widths
from pcsr_plugins.layers.dense_edge_conv import DenseEdgeConvStack
from pcsr_plugins.layers.options import Channels, Layers, NeighbourCount


class DenseEdgeConvs(DenseEdgeConvStack, Backbone):
    """Blocks of dense edge convolutions, joined by one layer that narrows what came so far.

    The coordinates come in through the features alone: each block looks for its neighbours among those.
    """

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        blocks: Layers = 4,
        layers: Layers = 3,
        growth: Channels = 24,
        between: Channels = 48,
        neighbours: NeighbourCount = 16,
    ) -> None:
        super().__init__(widths.visual, blocks, layers, growth, between, neighbours)
