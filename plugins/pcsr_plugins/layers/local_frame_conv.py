"""Edge convolution on rotation-invariant edge features.

As DGCNN's (Wang et al., "Dynamic Graph CNN for Learning on Point Clouds", ACM TOG 2019, Eq. 7), with lengths and
angles instead of coordinates, and the mean beside the maximum, since a curvature is an average.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.geometry.neighbours import gather
from pcsr.tensors import Features
from pcsr_plugins.layers.local_frames import SCALARS, LocalFrames


class LocalFrameConv(nn.Module):
    """Features of all edges of a point: e = ReLU(A·fᵢ + B·fⱼ + C·edgeᵢⱼ), then W·[max e, mean e]."""

    def __init__(self, c_in: int, c_out: int) -> None:
        super().__init__()
        self.here = nn.Linear(c_in, c_out)
        self.there = nn.Linear(c_in, c_out, bias=False)
        self.edge = nn.Linear(SCALARS, c_out, bias=False)
        self.out = nn.Linear(2 * c_out, c_out)

    def forward(
        self, features: Features, frames: LocalFrames, edges: Float[Tensor, "b n k 8"]
    ) -> Float[Tensor, "b n wide"]:
        """Convolve."""
        messages = self.edge(edges)  # (b n k wide), the largest tensor here: the rest is done in place
        messages += gather(self.there(features), frames.index)
        messages += self.here(features).unsqueeze(2)
        messages = messages.relu_()
        convolved: Tensor = self.out(torch.cat([messages.amax(2), messages.mean(2)], dim=-1))
        return convolved
