"""Midpoint interpolation with learned displacements.

The interpolation is Grad-PU's (He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with
Learned Distance Functions", CVPR 2023, Sec. 3.2), which separates it from what is learned and so takes any rate. Here
an MLP predicts how far to move, from the features of the nearest points. Before training it moves nothing: the
network *is* the interpolation.
"""

import torch
from torch import nn

from pcsr import Trait, Upsampler, Widths
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.neighbours import gather
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.heads import displacement_head
from pcsr_plugins.layers.interpolate import inverse_distance, mix
from pcsr_plugins.layers.midpoints import evenly, interpolated
from pcsr_plugins.layers.options import Channels
from pcsr_plugins.layers.spacing import spacing


class Midpoint(Upsampler):
    """Displaces interpolated candidates, in units of the local spacing."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE})

    def __init__(self, widths: Widths, *, hidden: Channels = 64) -> None:
        super().__init__()
        self.carried = nn.Linear(widths.refined, hidden)
        self.placed = nn.Linear(4, hidden, bias=False)
        self.mlp = displacement_head(hidden, 3)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Interpolate and refine.

        Inputs of the MLP are the features interpolated at a candidate, its offset from the mean of the points that they
        are of, and its distance to the nearest of them, which has no direction: a midpoint is as close to one end as to
        the other. The first layer's part for the features is applied before the interpolation: there are fewer points
        than candidates.
        """
        # Of equally close points the first in this order counts, not the first in the file.
        order = hilbert_order(points)
        points, features = along(order, points), along(order, features)
        candidates = interpolated(points, rate, thin=evenly if self.training else farthest_points)
        index, weights = inverse_distance(candidates, points)
        unit = mix(spacing(points), index, weights)
        offset = candidates - mix(points, index, weights)
        nearest = (candidates - gather(points, index[..., :1]).squeeze(2)).norm(dim=-1, keepdim=True)
        placed = self.placed(torch.cat([offset, nearest], dim=-1) / unit)
        dense: Dense = candidates + unit * self.mlp(mix(self.carried(features), index, weights) + placed)
        return dense
