"""The fusion `attention`: each visual point attends to the touched points nearest to it, and knows the way to each.

For q a visual point's query, k and v a touched point's key and value, and (w, u) what two layers make of the way
between the two, in each head::

    a = softmax over the nearest of  q·k / √channels + w
    f ← f + W·Σ a (v + u)

Attention whose logits and values hear the relative position, as in Zhao et al., "Point Transformer", ICCV 2021,
Sec. 3.2, here between two clouds. The way is given with its length: what is close by is not a linear matter.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr import Fusion, Register, Touches, Trait, Widths, hookimpl
from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Neighbours, Points

APART = 1e9
"""Where touched points that are none are put for the search, in units of the cloud: nearest to nobody."""


class Attention(Fusion):
    """Residual, and at first nothing is added: training starts from the visual network."""

    traits = frozenset({Trait.POINT_ORDER_FREE, Trait.TOUCH_ORDER_FREE})

    def __init__(
        self, widths: Widths, *, neighbours: int = 16, heads: int = 4, channels: int = 16, hidden: int = 32
    ) -> None:
        """Choose how many touched points are heard, and by what.

        Args:
            widths: of the features, from the host.
            neighbours: touched points that a visual point hears, the nearest ones.
            heads: of the attention.
            channels: of each head.
            hidden: of the layers that make something of the way to a touched point.
        """
        super().__init__()
        self.neighbours, self.heads, self.channels = neighbours, heads, channels
        self.query = nn.Linear(widths.visual, heads * channels)
        self.key = nn.Linear(widths.touch, heads * channels)
        self.value = nn.Linear(widths.touch, heads * channels)
        self.way = nn.Sequential(nn.Linear(4, hidden), nn.ReLU(), nn.Linear(hidden, heads * (1 + channels)))
        self.out = nn.Linear(heads * channels, widths.visual)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, points: Points, features: Features, touches: Touches) -> Features:
        """The module's two lines; (b n c) to (b n c)."""
        near = self._nearest(points, touches)
        query = self.query(features).unflatten(-1, (self.heads, self.channels))  # (b n h c)
        key, value = (
            gather(layer(touches.flat), near).unflatten(-1, (self.heads, self.channels))  # (b n k h c)
            for layer in (self.key, self.value)
        )
        nothing = touches.flat_padding.unsqueeze(1).expand(-1, points.shape[1], -1).gather(2, near)  # (b n k)
        # What is nowhere has no way to it; a number that is not finite would spoil the gradients, even unheard.
        ways = (gather(touches.flat_points, near) - points.unsqueeze(2)).masked_fill(nothing.unsqueeze(-1), 0.0)
        weight, heard = self._of_ways(ways)
        logits = torch.einsum("bnhc,bnkhc->bnkh", query, key) / math.sqrt(self.channels) + weight
        attention = logits.masked_fill(nothing.unsqueeze(-1), -torch.inf).softmax(2)
        added: Features = self.out(torch.einsum("bnkh,bnkhc->bnhc", attention, value + heard).flatten(2))
        return features + added

    def _nearest(self, points: Points, touches: Touches) -> Neighbours:
        """Indices of the touched points nearest to each visual point; those of touches that are none come last."""
        felt = touches.flat_points.detach().masked_fill(touches.flat_padding.unsqueeze(-1), APART)
        return knn(points.detach(), felt, min(self.neighbours, felt.shape[1]))

    def _of_ways(
        self, ways: Float[Tensor, "b n k 3"]
    ) -> tuple[Float[Tensor, "b n k heads"], Float[Tensor, "b n k heads channels"]]:
        """What the ways add to the logits, and to the values."""
        length = (ways.square().sum(-1, keepdim=True) + 1e-12).sqrt()  # the root of 0 has no gradient
        weight, heard = self.way(torch.cat([ways, length], dim=-1)).split(
            [self.heads, self.heads * self.channels], dim=-1
        )
        return weight, heard.unflatten(-1, (self.heads, self.channels))


@hookimpl
def pcsr_register(register: Register) -> None:
    """Tell pcsr the part's name."""
    register.fusion("attention", Attention)
