"""Cross-attention from visual to all touched points, with relative positions. Our own.

For the visual point p with feature f, and touched points tⱼ with features gⱼ, in each head::

    aⱼ = softmax over j of  q(f)·k(gⱼ) / √channels − λ |tⱼ − p|²
    f ← f + MLP[f, Σ aⱼ v(gⱼ), Σ aⱼ (tⱼ − p), Σ aⱼ |tⱼ − p|²]

λ is learned, and starts at another value in each head: heads of large λ attend to the nearest touched points, heads of
small λ to a region. The last term tells how far away the attended points are, so that the MLP can leave out touches
that are elsewhere. It is fused attention over products (Vaswani et al., "Attention Is All You Need", NeurIPS 2017):
of |t|² − 2 p·t + |p|² the last term is the same for all j, and the others are products of p and of t.
"""

import math
from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Fusion, TouchBatch, Trait, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.heads import zero_linear
from pcsr_plugins.layers.options import Channels

DECAYS = (1000.0, 1.0)
"""Initial λ of the first and the last head, those between on a logarithmic scale, in 1 / radius² of the cloud: a
touched point at a distance of 1/√λ weighs e times less than one at the visual point itself."""


class CrossAttention(Fusion):
    """Residual cross-attention, zero-initialised: training starts from the visual network."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        heads: Annotated[int, Field(ge=1, le=64)] = 4,
        channels: Channels = 12,
        hidden: Channels = 64,
    ) -> None:
        """Create the attention.

        Args:
            widths: of the features, from the host.
            heads: number of attention heads.
            channels: channels of each head.
            hidden: channels of the MLP of what was attended to.
        """
        super().__init__()
        self.heads, self.channels = heads, channels
        self.query = nn.Linear(widths.visual, heads * channels)
        self.key = nn.Linear(widths.touch, heads * channels)
        self.value = nn.Linear(widths.touch, heads * channels)
        first, last = map(math.log, DECAYS)
        self.log_decay = nn.Parameter(torch.linspace(first, last, heads))
        self.out = nn.Sequential(
            nn.Linear(widths.visual + heads * (channels + 4), hidden), nn.ReLU(), zero_linear(hidden, widths.visual)
        )

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Add what the visual points attend to."""
        # The values of a missing touch may not be finite, which would spoil the sums even with a weight of 0.
        missing = touches.flat_padding.unsqueeze(-1)
        touched, message = touches.flat_points.masked_fill(missing, 0.0), touches.flat.masked_fill(missing, 0.0)
        centre, touched = points.unsqueeze(1), touched.unsqueeze(1)  # (b 1 n 3), (b 1 m 3)
        decay = self.log_decay.exp()[:, None, None]  # (h 1 1)
        query = self._heads(self.query(features)) / math.sqrt(self.channels)  # (b h n c)
        query = torch.cat([query, 2 * decay * centre, (-decay).expand_as(query[..., :1])], dim=-1)
        squared = touched.square().sum(-1, keepdim=True)
        position = torch.cat([touched, squared], dim=-1).expand(-1, self.heads, -1, -1)  # (b h m 4)
        key, value = (torch.cat([self._heads(layer(message)), position], dim=-1) for layer in (self.key, self.value))
        sums = F.scaled_dot_product_attention(query, key, value, ~missing.mT.unsqueeze(1), scale=1.0)
        values, mean, mean_squared = torch.split(sums, [self.channels, 3, 1], dim=-1)
        distance = mean_squared + (centre.square() - 2 * mean * centre).sum(-1, keepdim=True)
        attended = torch.cat([values, mean - centre, distance], dim=-1).transpose(1, 2).flatten(2)  # (b n h·(c + 4))
        added: Features = self.out(torch.cat([features, attended], dim=-1))
        return features + added

    def _heads(self, x: Float[Tensor, "b n hc"]) -> Float[Tensor, "b h n c"]:
        return x.view(*x.shape[:2], self.heads, self.channels).transpose(1, 2)
