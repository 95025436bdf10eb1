"""The feature extractor of Grad-PU: dense blocks of point convolutions, the map of each block kept.

He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with Learned Distance Functions",
CVPR 2023, Sec. 3.3 (P2PNet). Each point gets 160 channels: four local maps, the encoder's and one of each block, and
the greatest value of the last map over the whole cloud. What the paper leaves open is as in its code: batch norms,
the sum over neighbours (the point itself is one of them), one graph for all blocks.

A channel of the first map comes from one point, one of the last from a wide neighbourhood; the upsampler
(`descent`) reads all maps between the points.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr import Backbone, Trait, Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Neighbours, Points
from pcsr_plugins.layers.linear_norm_relu import LinearNormReLU
from pcsr_plugins.layers.options import Channels, Layers, NeighbourCount

Offsets = Float[Tensor, "b n k 3"]


class GradPU(Backbone):
    """Three dense blocks of three layers each."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        blocks: Layers = 3,
        layers: Layers = 3,
        width: Channels = 32,
        growth: Channels = 32,
        bottleneck: Channels = 32,
        neighbours: NeighbourCount = 16,
    ) -> None:
        super().__init__()
        self.neighbours = neighbours
        self.channels = widths.visual + (blocks + 1) * width
        wide = [widths.visual, *[width] * blocks]
        self.blocks = nn.ModuleList(DenseBlock(c, width, layers, growth, bottleneck) for c in wide[:-1])

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """All local maps, then the global one; the graph is that of the coordinates."""
        index = knn(points, points, self.neighbours)
        offsets = gather(points, index) - points.unsqueeze(2)  # (b n k 3)
        maps = [features]
        for block in self.blocks:
            maps.append(block(maps[-1], offsets, index))
        everywhere = maps[-1].amax(1, keepdim=True).expand_as(maps[-1])  # (b n width)
        return torch.cat([*maps, everywhere], dim=-1)


class DenseBlock(nn.Module):
    """Layers that each add `growth` channels to all before them, then a transition back to `width`."""

    def __init__(self, c_in: int, width: int, layers: int, growth: int, bottleneck: int) -> None:
        super().__init__()
        self.layers = nn.ModuleList(DenseLayer(c_in + step * growth, growth, bottleneck) for step in range(layers))
        self.transition = LinearNormReLU(c_in + layers * growth, width)

    def forward(self, features: Features, offsets: Offsets, index: Neighbours) -> Float[Tensor, "b n width"]:
        """The block's map."""
        for layer in self.layers:
            features = torch.cat([features, layer(features, offsets, index)], dim=-1)
        refined: Features = self.transition(features)
        return refined


class DenseLayer(nn.Module):
    """A bottleneck for each point, then a point convolution."""

    def __init__(self, c_in: int, growth: int, bottleneck: int) -> None:
        super().__init__()
        self.bottleneck = LinearNormReLU(c_in, bottleneck)
        self.convolution = PointConvolution(bottleneck, growth)

    def forward(self, features: Features, offsets: Offsets, index: Neighbours) -> Float[Tensor, "b n growth"]:
        """The new channels."""
        new: Features = self.convolution(self.bottleneck(features), offsets, index)
        return new


class PointConvolution(nn.Module):
    """Σ over j of post(W·(xⱼ − xᵢ) · feature(fⱼ)): the product is taken channel by channel."""

    def __init__(self, c_in: int, c_out: int) -> None:
        super().__init__()
        self.way = LinearNormReLU(3, c_out)
        self.feature = LinearNormReLU(c_in, c_out)
        self.post = LinearNormReLU(c_out, c_out)

    def forward(self, features: Features, offsets: Offsets, index: Neighbours) -> Float[Tensor, "b n growth"]:
        """Convolve over the neighbourhoods."""
        summed: Tensor = self.post(self.way(offsets) * self._messages(features, index)).sum(2)  # (b n k c) → (b n c)
        return summed

    def _messages(self, features: Features, index: Neighbours) -> Float[Tensor, "b n k c2"]:
        """Message of each neighbour, computed once for each point instead of each edge."""
        if not self.training:
            messages: Features = self.feature(features)
            return gather(messages, index)
        # The norm's statistics are those of the edges: a point counts as often as it is a neighbour.
        return self.feature.normalised(gather(self.feature.linear(features), index))
