"""Edge convolution from the nearest touched points to each visual point; touched points are part of the result.

Our own. The paper pairs the i-th touch feature with the i-th visual feature (Sec. 3.3), though neither order means
anything. Here each visual point receives messages along the edges to the touched points nearest to it, as in DGCNN's
edge convolution (Wang et al., "Dynamic Graph CNN for Learning on Point Clouds", ACM TOG 2019, Eq. 7), between two
clouds, with the offset dⱼ to the touched point j::

    f ← f + W·max over the nearest j of ReLU(A·f + B·tⱼ + C·[dⱼ, |dⱼ|])

Touched points lie on the surface exactly, so they replace the points that the network generated around them
(`keeps_touched_points`).
"""

import torch
from torch import nn
from torch.nn import functional as F

from pcsr import Fusion, TouchBatch, Trait, Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.options import Channels, Count, NeighbourCount

APART = 1e4
"""Coordinate of the points of a missing touch in the neighbour search, in radii of the cloud: too far to be found."""


class EdgeConvFusion(Fusion):
    """Residual edge convolution, zero-initialised: training starts from the visual network."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})
    keeps_touched_points = True

    def __init__(
        self,
        widths: Widths,
        *,
        neighbours: NeighbourCount = 12,
        points_per_touch: Count = 64,
        hidden: Channels = 64,
        keeps_touched_points: bool = True,
    ) -> None:
        """Choose how many touched points send messages.

        Args:
            widths: of the features, from the host.
            neighbours: nearest touched points that send messages to a visual point.
            points_per_touch: candidates for these of each touch, spread evenly over it: the nearest ones of a dense
                touch would nearly all lie on one spot.
            hidden: channels of an edge.
            keeps_touched_points: whether touched points are part of the result. If not, touch enters through the
                features alone.
        """
        super().__init__()
        self.keeps_touched_points = keeps_touched_points
        self.neighbours, self.points_per_touch = neighbours, points_per_touch
        self.here = nn.Linear(widths.visual, hidden)
        self.there = nn.Linear(widths.touch, hidden, bias=False)
        self.way = nn.Linear(4, hidden, bias=False)
        self.out = nn.Linear(hidden, widths.visual)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Add the messages of the `neighbours` nearest touched points, or of all where there are fewer."""
        touched, touch_features, missing = self._thinned(touches)
        index = knn(
            points.detach(), torch.where(missing.unsqueeze(-1), APART, touched), min(self.neighbours, touched.shape[1])
        )
        absent = missing.unsqueeze(1).expand(-1, points.shape[1], -1).gather(2, index).unsqueeze(-1)  # (b n k 1)
        # The points of a missing touch may not be finite, which would spoil the gradients even where masked.
        offsets = (gather(touched, index) - points.unsqueeze(2)).masked_fill(absent, 0.0)
        length = (offsets.square().sum(-1, keepdim=True) + 1e-12).sqrt()  # the root of 0 has no gradient
        edges = (
            self.here(features).unsqueeze(2)
            + gather(self.there(touch_features), index)
            + self.way(torch.cat([offsets, length], -1))
        )
        messages = F.relu(edges).masked_fill(absent, 0.0).amax(2)
        added: Features = self.out(messages)
        return features + added

    def _thinned(self, touches: TouchBatch) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Every k-th point of each touch along its Hilbert curve, its features, and whether it is missing."""
        m, c = touches.features.shape[2:]
        kept = min(self.points_per_touch, m)
        step = torch.arange(kept, device=touches.points.device) * m // kept
        index = hilbert_order(touches.points)[..., step].unsqueeze(-1)  # (b a kept 1)
        touched = touches.points.gather(2, index.expand(-1, -1, -1, 3)).flatten(1, 2)
        touch_features = touches.features.gather(2, index.expand(-1, -1, -1, c)).flatten(1, 2)
        return touched, touch_features, ~touches.mask.repeat_interleave(kept, dim=1)
