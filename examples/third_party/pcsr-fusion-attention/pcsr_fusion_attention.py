"""The fusion `attention`: each visual point attends to the nearest touched points, with relative positions.

For the query q of a visual point, key k and value v of a touched point, and (w, u) the output of an MLP for the offset
between the two, in each head::

    a = softmax over the nearest of  q·k / √channels + w
    f ← f + W·Σ a (v + u)

The relative position enters logits and values, as in Zhao et al., "Point Transformer", ICCV 2021, Sec. 3.2, here
between two clouds. The MLP gets the length of the offset too, which is not linear in its coordinates.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr import Fusion, Register, TouchBatch, Trait, Widths, hookimpl
from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Neighbours, Points

APART = 1e9
"""Coordinates of the points of missing touches in the search, so that they are never among the nearest."""


class Attention(Fusion):
    """Attention from visual to touched points. Its output layer starts at zero: touch has no effect at first."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})

    def __init__(
        self, widths: Widths, *, neighbours: int = 16, heads: int = 4, channels: int = 16, hidden: int = 32
    ) -> None:
        """Create the fusion.

        Args:
            widths: of the features, from the host.
            neighbours: number of nearest touched points that a visual point attends to.
            heads: number of attention heads.
            channels: number of channels of each head.
            hidden: channels of the MLP of the offsets.
        """
        super().__init__()
        self.neighbours, self.heads, self.channels = neighbours, heads, channels
        self.query = nn.Linear(widths.visual, heads * channels)
        self.key = nn.Linear(widths.touch, heads * channels)
        self.value = nn.Linear(widths.touch, heads * channels)
        self.position = nn.Sequential(nn.Linear(4, hidden), nn.ReLU(), nn.Linear(hidden, heads * (1 + channels)))
        self.out = nn.Linear(heads * channels, widths.visual)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Fuse touches with visual features (b n c); the shape stays the same."""
        neighbours = self._nearest(points, touches)
        query = self.query(features).unflatten(-1, (self.heads, self.channels))  # (b n h c)
        key, value = (
            gather(layer(touches.flat), neighbours).unflatten(-1, (self.heads, self.channels))  # (b n k h c)
            for layer in (self.key, self.value)
        )
        missing = touches.flat_padding.unsqueeze(1).expand(-1, points.shape[1], -1).gather(2, neighbours)  # (b n k)
        # Infinite offsets of missing touches would give gradients that are not finite, even with a weight of zero.
        offsets = gather(touches.flat_points, neighbours) - points.unsqueeze(2)
        weight, message = self._encoded(offsets.masked_fill(missing.unsqueeze(-1), 0.0))
        logits = torch.einsum("bnhc,bnkhc->bnkh", query, key) / math.sqrt(self.channels) + weight
        attention = logits.masked_fill(missing.unsqueeze(-1), -torch.inf).softmax(2)
        added: Features = self.out(torch.einsum("bnkh,bnkhc->bnhc", attention, value + message).flatten(2))
        return features + added

    def _nearest(self, points: Points, touches: TouchBatch) -> Neighbours:
        """Indices of the touched points nearest to each visual point; those of missing touches come last."""
        touched = touches.flat_points.detach().masked_fill(touches.flat_padding.unsqueeze(-1), APART)
        return knn(points.detach(), touched, min(self.neighbours, touched.shape[1]))

    def _encoded(
        self, offsets: Float[Tensor, "b n k 3"]
    ) -> tuple[Float[Tensor, "b n k heads"], Float[Tensor, "b n k heads channels"]]:
        """Terms of the offsets in the logits and in the values."""
        length = (offsets.square().sum(-1, keepdim=True) + 1e-12).sqrt()  # the root of 0 has no gradient
        weight, message = self.position(torch.cat([offsets, length], dim=-1)).split(
            [self.heads, self.heads * self.channels], dim=-1
        )
        return weight, message.unflatten(-1, (self.heads, self.channels))


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the part."""
    register.fusion("attention", Attention)
