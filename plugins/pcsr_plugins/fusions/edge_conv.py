"""Touch as geometry: each visual point hears the touched points around it, and these are part of the result.

Our own. The paper pairs the i-th touch feature with the i-th visual feature (Sec. 3.3), though neither order means
anything. Here the edge from a visual point to each of the touched points nearest to it is what is heard, in the way
of DGCNN's edge convolution (Wang et al., "Dynamic Graph CNN for Learning on Point Clouds", ACM TOG 2019, Eq. 7)
between two clouds::

    f ← f + W·max over the nearest j of ReLU(A·f + B·tⱼ + C·[wayⱼ, |wayⱼ|])

And since nothing knows the surface better than a touched point, the host puts them in the place of what the network
made around them (`keeps_touched_points`).
"""

from typing import ClassVar

import torch
from torch import nn
from torch.nn import functional as F

from pcsr import Fusion, TouchBatch, Trait, Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.options import Channels, Count, NeighbourCount

APART = 1e4
"""Where the points of a missing touch are put for the search, in radii of the cloud: nearest to nobody."""


class EdgeConvFusion(Fusion):
    """Residual, and at first nothing is added: training starts from the visual network."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})
    keeps_touched_points: ClassVar[bool] = True

    def __init__(
        self, widths: Widths, *, neighbours: NeighbourCount = 12, points_per_touch: Count = 64, hidden: Channels = 64
    ) -> None:
        """Choose how many touched points send messages.

        Args:
            widths: of the features, from the host.
            neighbours: touched points that a visual point hears, the nearest ones.
            points_per_touch: points of each touch that can, spread evenly over it: nearly all of the nearest ones of
                a dense touch would lie on one spot.
            hidden: channels of an edge.
        """
        super().__init__()
        self.neighbours, self.points_per_touch = neighbours, points_per_touch
        self.here = nn.Linear(widths.visual, hidden)
        self.there = nn.Linear(widths.touch, hidden, bias=False)
        self.way = nn.Linear(4, hidden, bias=False)
        self.out = nn.Linear(hidden, widths.visual)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """The module's line; a visual point hears fewer where there are fewer."""
        felt, said, missing = self._thinned(touches)
        near = knn(
            points.detach(), torch.where(missing.unsqueeze(-1), APART, felt), min(self.neighbours, felt.shape[1])
        )
        absent = missing.unsqueeze(1).expand(-1, points.shape[1], -1).gather(2, near).unsqueeze(-1)  # (b n k 1)
        # What is nowhere has no way to it; a number that is not finite would spoil the gradients, even unheard.
        ways = (gather(felt, near) - points.unsqueeze(2)).masked_fill(absent, 0.0)
        length = (ways.square().sum(-1, keepdim=True) + 1e-12).sqrt()  # the root of 0 has no gradient
        edges = (
            self.here(features).unsqueeze(2) + gather(self.there(said), near) + self.way(torch.cat([ways, length], -1))
        )
        heard = F.relu(edges).masked_fill(absent, 0.0).amax(2)
        added: Features = self.out(heard)
        return features + added

    def _thinned(self, touches: TouchBatch) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Every so manieth point of each touch along its Hilbert curve, its features, and whether it is missing."""
        m, c = touches.features.shape[2:]
        heard = min(self.points_per_touch, m)
        step = torch.arange(heard, device=touches.points.device) * m // heard
        index = hilbert_order(touches.points)[..., step].unsqueeze(-1)  # (b a heard 1)
        felt = touches.points.gather(2, index.expand(-1, -1, -1, 3)).flatten(1, 2)
        said = touches.features.gather(2, index.expand(-1, -1, -1, c)).flatten(1, 2)
        return felt, said, ~touches.mask.repeat_interleave(heard, dim=1)
