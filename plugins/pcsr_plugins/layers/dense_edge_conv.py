"""The dense edge convolution of 3PU, PU-GAN and Dis-PU: a small dense net on the edges of the feature graph.

Wang et al., "Patch-based Progressive 3D Point Set Upsampling", CVPR 2019, Sec. 3.2; Li et al., "PU-GAN", ICCV 2019,
and Li et al., "Point Cloud Upsampling via Disentangled Refinement", CVPR 2021, take it over. Of three layers::

    y₁ = ReLU(W₁·[xᵢ, xⱼ − xᵢ] + b₁)
    y₂ = ReLU(W₂·[y₁, xᵢ] + b₂)
    y₃ =      W₃·[y₂, y₁, xᵢ] + b₃
    x' = max over j of [y₃, y₂, y₁, xᵢ]

The neighbours j are the nearest by features, not by coordinates, without i itself. The last layer has no activation.
"""

from collections.abc import Iterable
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Points


class DenseEdgeConv(nn.Module):
    """The block of the module's docstring.

    Each W splits into what it does to an edge and what it does to a point. The latter doesn't depend on j and is
    worked out once for each point, so that nothing on the edges is wider than `growth`.
    """

    def __init__(self, c_in: int, growth: int, layers: int, neighbours: int) -> None:
        super().__init__()
        self.channels = c_in + layers * growth
        self.neighbours = neighbours
        self.layers = nn.ModuleList(
            nn.Linear(c_in + (step * growth if step else c_in), growth) for step in range(layers)
        )

    def forward(self, features: Features) -> Float[Tensor, "b n wide"]:
        """The newest layer's channels first, the input's last.

        Raises:
            UserError: the cloud has no more points than a point has neighbours.
        """
        index = knn(features, features, self.neighbours + 1)[..., 1:]
        edges: list[Float[Tensor, "b n k growth"]] = []
        points, channels = [features], features.shape[-1]
        for layer in cast("Iterable[nn.Linear]", self.layers):
            if not edges:
                u, v = layer.weight.chunk(2, dim=1)
                y = gather(F.linear(features, v), index)
                own = F.linear(features, u - v, layer.bias)
            else:
                on_edges, on_point = torch.split(layer.weight, [layer.in_features - channels, channels], dim=1)
                y = F.linear(torch.cat(edges, dim=-1), on_edges)
                own = F.linear(features, on_point, layer.bias)
            if len(edges) + 1 == len(self.layers):
                points.insert(0, y.amax(2) + own)
            else:
                edges.insert(0, F.relu(y + own.unsqueeze(2)))
                points.insert(0, edges[0].amax(2))
        return torch.cat(points, dim=-1)


class DenseEdgeConvStack(nn.Module):
    """Blocks of dense edge convolutions in a row, each on all features so far, narrowed by one layer.

    At the widths of PU-GAN its 24 input channels become 120, 240, 360 and 480.
    """

    def __init__(self, c_in: int, blocks: int, layers: int, growth: int, between: int, neighbours: int) -> None:
        super().__init__()
        self.channels = c_in
        self.blocks, self.narrow = nn.ModuleList(), nn.ModuleList()
        for step in range(blocks):
            if step:
                self.narrow.append(nn.Linear(self.channels, between))
            block = DenseEdgeConv(between if step else c_in, growth, layers, neighbours)
            self.blocks.append(block)
            self.channels += block.channels

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """Refined features; the newest channels come first, the input's last. The coordinates are not used."""
        for step, block in enumerate(self.blocks):
            narrow = F.relu(self.narrow[step - 1](features)) if step else features
            features = torch.cat([block(narrow), features], dim=-1)
        return features
