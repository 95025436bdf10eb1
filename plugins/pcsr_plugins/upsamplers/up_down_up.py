"""PU-GAN's up-down-up expansion: expand, reduce, and expand the difference again.

Li et al., "PU-GAN: a Point Cloud Upsampling Adversarial Network", ICCV 2019, Sec. 3.2, Fig. 3::

    L  = ReLU(W·F)             the backbone's features, narrower
    H₀ = up₀(L)                r times as many
    H  = H₀ + up₁(down(H₀) − L)
    Q  = MLP(H)                coordinates themselves, not an offset from the input point

As in the original's code it makes more points than wanted, 6n for a rate of 4; the network keeps the farthest 4n.
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.grid import grid
from pcsr_plugins.layers.options import QuarteredChannels
from pcsr_plugins.layers.self_attention import SelfAttention

HIDDEN = 64
"""Channels before the coordinates."""


class UpDownUp(Upsampler):
    """The lines of the module's docstring; `surplus` is the number of copies of each point beyond those wanted."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self, widths: Widths, *, channels: QuarteredChannels = 128, surplus: Annotated[int, Field(ge=0, le=16)] = 2
    ) -> None:
        super().__init__()
        self.rate = widths.rate
        copies = widths.rate + surplus
        self.narrow = nn.Linear(widths.refined, channels)
        self.up = Up(channels, copies)
        self.down = Down(channels, copies)
        self.again = Up(channels, copies)
        self.regressor = nn.Sequential(nn.Linear(channels, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 3))

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Expand and reconstruct: (rate + surplus)·n points."""
        if rate != self.rate:
            raise UserError(f"this 'up-down-up' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        low = F.relu(self.narrow(features))
        high = self.up(low)
        high = high + self.again(self.down(high) - low)
        dense: Dense = self.regressor(high)
        return dense


class Up(nn.Module):
    """Each point's copies in a row, distinguished by a grid point; then self-attention and two layers."""

    grid: Tensor

    def __init__(self, channels: int, copies: int) -> None:
        super().__init__()
        self.register_buffer("grid", grid(copies), persistent=False)
        self.attention = SelfAttention(channels + 2)
        self.mlp = nn.Sequential(
            nn.Linear(channels + 2, 2 * channels), nn.ReLU(), nn.Linear(2 * channels, channels), nn.ReLU()
        )

    def forward(self, low: Features) -> Float[Tensor, "b rn c"]:
        """(b n c) to (b copies·n c)."""
        copies = low.unsqueeze(2).expand(-1, -1, len(self.grid), -1)
        codes = self.grid.to(low.dtype).expand(*low.shape[:2], -1, -1)
        high: Tensor = self.mlp(self.attention(torch.cat([copies, codes], dim=-1).flatten(1, 2)))
        return high


class Down(nn.Module):
    """All copies of a point into one: the original's convolution over the copies, then another layer."""

    def __init__(self, channels: int, copies: int) -> None:
        super().__init__()
        self.copies = copies
        self.mlp = nn.Sequential(
            nn.Linear(copies * channels, 2 * channels), nn.ReLU(), nn.Linear(2 * channels, channels), nn.ReLU()
        )

    def forward(self, high: Float[Tensor, "b rn c"]) -> Features:
        """(b copies·n c) to (b n c)."""
        b, rn, c = high.shape
        low: Features = self.mlp(high.reshape(b, rn // self.copies, self.copies * c))
        return low
