"""Touch features concatenated with the visual ones (TAPSR, Sec. 4.4, Table 4, second row).

"We removed the feature fusion module and directly concatenated the sparse features with the tactile features."
Along the channels, as in the FF block's own Concat: each visual feature is followed by those of every touch,
touches that are missing count as zeros, and one layer brings the width back to what the backbone takes.
"""

from typing import Annotated

import torch
from pydantic import Field
from torch import nn

from pcsr import Fusion, TouchBatch, Trait, UserError, Widths
from pcsr.tensors import Features, Points
from pcsr_plugins.layers.pairing import pair


class Concat(Fusion):
    """All touches side by side, in the order given."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths: Widths, *, touches: Annotated[int, Field(ge=1, le=16)] = 5) -> None:
        super().__init__()
        self.slots = touches
        self.layer = nn.Linear(widths.visual + touches * widths.touch, widths.visual)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Concatenate and mix.

        Raises:
            UserError: there are more touches than slots.
        """
        count = touches.mask.shape[1]
        if count > self.slots:
            raise UserError(
                f"fusion 'concat' has slots for {self.slots} touches, got {count}: set model.fusion.touches to {count}"
            )
        messages = pair(points, touches) * touches.mask[:, :, None, None]  # (b a n c)
        messages = messages.transpose(1, 2).flatten(2)  # (b n a·c)
        missing = messages.new_zeros(*messages.shape[:2], (self.slots - count) * touches.features.shape[-1])
        fused: Features = self.layer(torch.cat([features, messages, missing], dim=-1))
        return fused
