"""Self-attention in the form of SAGAN, which PU-GAN's generator and discriminator use.

Zhang et al., "Self-Attention Generative Adversarial Networks", ICML 2019; Li et al., "PU-GAN", ICCV 2019, Sec. 3.2 and
Fig. 4. As in PU-GAN's code queries, keys and values pass a ReLU, and the logits are not scaled.
"""

import torch
from torch import nn
from torch.nn import functional as F

from pcsr.tensors import Features

NARROWER = 4
"""Queries and keys have so many times fewer channels."""
LANES = 8
"""Attention is worked out over a multiple of so many channels."""


class SelfAttention(nn.Module):
    """x + γ·softmax(q·kᵀ)·v over all points of a cloud; γ is learned and starts at 0, so that at first it is x.

    The logits (b n n) are never kept: fused attention works them out a block at a time, in the backward pass once more.
    Its kernels want one width for all three, and are fastest at multiples of eight: zeros fill them up and change
    nothing.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.query = nn.Linear(channels, channels // NARROWER)
        self.key = nn.Linear(channels, channels // NARROWER)
        self.value = nn.Linear(channels, channels)
        self.gamma = nn.Parameter(torch.zeros(()))

    def forward(self, x: Features) -> Features:
        """Attend to all points."""
        c = x.shape[-1]
        wide = (F.relu(layer(x)).unsqueeze(1) for layer in (self.query, self.key, self.value))  # (b heads n c), 1 head
        q, k, v = (F.pad(part, (0, c + -c % LANES - part.shape[-1])) for part in wide)
        attended = F.scaled_dot_product_attention(q, k, v, scale=1.0)
        return x + self.gamma * attended.squeeze(1)[..., :c]
