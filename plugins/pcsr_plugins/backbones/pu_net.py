"""The hierarchical feature learning and multi-level aggregation of PU-Net.

Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, with the sizes of its code: of four levels of
PointNet++ the first is the encoder `set-abstraction`. The others see n/2, n/4 and n/8 points through balls of radius
0.1, 0.2 and 0.3. Each is carried back to all n points and reduced to 64 channels, and all are laid side by side with
the first level's features and the coordinates: 3·64 + 64 + 3 = 259 channels.

The points of a level are the farthest of the level before; since each of these is farthest from all before it, they
are the first ones of one row of farthest points.
"""

from itertools import pairwise
from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Backbone, Trait, UserError, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.farthest import farthest
from pcsr_plugins.layers.interpolate import interpolate
from pcsr_plugins.layers.options import Channels, Count, HalvedCascade, Positive
from pcsr_plugins.layers.set_abstraction import SetAbstraction


class PUNet(Backbone):
    """Levels of ever fewer points, each carried back to all of them."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        channels: HalvedCascade = (128, 256, 512),
        radii: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=16)] = (0.1, 0.2, 0.3),
        samples: Count = 32,
        reduced: Channels = 64,
    ) -> None:
        super().__init__()
        if len(radii) != len(channels):
            raise UserError(
                f"backbone 'pu-net' has {len(channels)} levels by its channels and {len(radii)} by its radii: "
                f"give each level both"
            )
        self.channels = len(channels) * reduced + widths.visual + 3
        self.levels = nn.ModuleList(
            SetAbstraction(c_in, (c_out // 2, c_out // 2, c_out), radius, samples)
            for (c_in, c_out), radius in zip(pairwise((widths.visual, *channels)), radii, strict=True)
        )
        self.reduce = nn.ModuleList(nn.Linear(c, reduced) for c in channels)

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """Aggregate the levels, the coarsest first."""
        n = points.shape[1]
        rows = farthest(points, max(1, n // 2))
        below, known, sides = points, features, [features, points]
        for step, (level, reduce) in enumerate(zip(self.levels, self.reduce, strict=True), 1):
            centres = rows[:, : max(1, n // 2**step)]
            known = level(centres, below, known)
            below = centres
            # Weights that sum to one: reducing first is the same, and there are fewer points.
            carried = interpolate(points, centres, reduce(known), min(3, centres.shape[1]), power=2)
            sides.insert(0, F.relu(carried))
        return torch.cat(sides, dim=-1)
