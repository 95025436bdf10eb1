"""The feature expansion and coordinate reconstruction of PU-Net: for each new point a branch of its own.

Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, with the sizes of its code: r separate
branches of two layers, 256 and 128 channels wide; one regressor, 64 and 3, gives absolute coordinates.

PU-GCN (Qian et al., CVPR 2021) publishes 812.0 K weights for PU-Net. Those are of its own implementation, in which the
first layer of each branch but the first takes the output of the first layer of the branch before instead of the
features. PU-Net's own code has separate branches and 2,304 weights more.
"""

import torch
from torch import nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.options import Channels


class Branches(Upsampler):
    """`rate` branches, laid end to end along the points."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        channels: tuple[Channels, Channels] = (256, 128),
        hidden: Channels = 64,
    ) -> None:
        super().__init__()
        self.rate = widths.rate
        inner, outer = channels
        self.first = nn.ModuleList(nn.Linear(widths.refined, inner) for _ in range(widths.rate))
        self.second = nn.ModuleList(nn.Linear(inner, outer) for _ in range(widths.rate))
        self.regressor = nn.Sequential(nn.Linear(outer, hidden), nn.ReLU(), nn.Linear(hidden, 3))

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Expand and reconstruct: the i-th point of the j-th branch stands at j·n + i."""
        if rate != self.rate:
            raise UserError(f"this 'branches' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        branches = zip(self.first, self.second, strict=True)
        expanded = torch.cat([F.relu(second(F.relu(first(features)))) for first, second in branches], dim=1)
        dense: Dense = self.regressor(expanded)
        return dense
