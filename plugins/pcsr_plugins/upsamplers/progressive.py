"""The levels of 3PU (MPU): each doubles the points of the one before, from features of their own.

Wang et al., "Patch-based Progressive 3D Point Set Upsampling", CVPR 2019, with the sizes of its code. A level
has features f of the points p of its cloud. Each point becomes two copies, distinguished by a code of one number::

    q = p + MLP([f, code])                                  128, 128, 64 and 3 channels wide

The first level's features are the backbone's. A later level brings the cloud into the unit sphere, extracts features
with layers of its own, the backbone's again, and adds 0.2 times those that the level before had nearby, weighed by
distance in space and among the features: its skip connections between levels.

Number of weights: PU-GCN (Qian et al., CVPR 2021) publishes 76.2 K, of its own implementation of 3PU, which makes all
four copies in one level, distinguished by a 2 × 2 grid. A level of 3PU itself, doubling, has 76,027; there are two of
them for a rate of 4.

3PU cuts clouds of more than 312 points into patches between the levels. Here a level sees the whole cloud, which at the
second level of a patch of 256 points has 512.
"""

import math
from collections import OrderedDict
from typing import Annotated

import torch
from jaxtyping import Float, Int
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Upsampler, UserError, Widths
from pcsr.geometry.neighbours import knn
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.dense_edge_conv import DenseEdgeConvStack
from pcsr_plugins.layers.grid import EXTENT
from pcsr_plugins.layers.options import Channels, NeighbourCount

Rows = Float[Tensor, "b q c"]


class Progressive(Upsampler):
    """As many levels, each of which doubles, as lead to the rate."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(
        self,
        widths: Widths,
        *,
        encoded: Channels = 24,
        growth: Channels = 12,
        neighbours: NeighbourCount = 16,
        nearby: NeighbourCount = 5,
        share: Annotated[float, Field(ge=0, le=1e6)] = 0.2,
    ) -> None:
        super().__init__()
        levels = round(math.log2(widths.rate)) if widths.rate > 1 else 0
        if 2**levels != widths.rate or not levels:
            raise UserError(
                f"upsampler 'progressive' goes up in steps of 2 and never meets the rate {widths.rate}: "
                f"choose a power of 2"
            )
        self.rate = widths.rate
        self.nearby = nearby
        self.share = share
        extractors = [Extractor(encoded, growth, neighbours) for _ in range(levels - 1)]
        known = [widths.refined] + [extractor.channels for extractor in extractors]
        self.extractors = nn.ModuleList(extractors)
        self.expansions = nn.ModuleList(Expansion(channels) for channels in known)
        # Another backbone may give another number of channels than the levels' own layers.
        wide = known[-1]
        self.fit = nn.Identity() if widths.refined == wide else nn.Linear(widths.refined, wide)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """The last level's cloud."""
        return self.stages(points, features, rate)[-1]

    def stages(self, points: Points, features: Features, rate: int) -> list[Dense]:
        """The clouds of all levels."""
        if rate != self.rate:
            raise UserError(f"this 'progressive' was built for rate {self.rate}, not {rate}: train one for rate {rate}")
        first, *others = self.expansions
        clouds: list[Dense] = [first(points, features)]
        before, known = points, self.fit(features)
        for extractor, expansion in zip(self.extractors, others, strict=True):
            cloud = clouds[-1]
            framed, centre, radius = unit_sphere(cloud)
            fresh = extractor(framed)
            known = fresh + self.share * nearby_mean(cloud, fresh, before, known, self.nearby)
            before = cloud
            clouds.append(centre + radius * expansion(framed, known))
        return clouds


class Extractor(nn.Module):
    """A later level's own encoder and backbone, the same as the first level's."""

    def __init__(self, encoded: int, growth: int, neighbours: int) -> None:
        super().__init__()
        self.encoder = nn.Sequential(OrderedDict(layer=nn.Linear(3, encoded)))  # weights are named as those of `linear`
        self.backbone = DenseEdgeConvStack(encoded, 4, 3, growth, 2 * growth, neighbours)
        self.channels = self.backbone.channels

    def forward(self, points: Points) -> Features:
        """Features of each point."""
        features: Features = self.backbone(points, self.encoder(points))
        return features


class Expansion(nn.Module):
    """Each point's copies, one after the other, each displaced by an MLP on its features and its code."""

    code: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        code = torch.tensor([[-EXTENT], [EXTENT]])
        self.register_buffer("code", code, persistent=False)
        self.enter = nn.Linear(channels + code.shape[1], 128)
        self.mlp = nn.Sequential(
            nn.ReLU(), nn.Linear(128, 128), nn.ReLU(), nn.Linear(128, 64), nn.ReLU(), nn.Linear(64, 3)
        )

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b copies 3"]:
        """(b n 3) to (b 2·n 3)."""
        # The first layer is linear in features and code: the features go through it once, not once for each copy.
        channels = features.shape[-1]
        of_features, of_code = self.enter.weight[:, :channels], self.enter.weight[:, channels:]
        point = F.linear(features, of_features, self.enter.bias).unsqueeze(2)
        moves = self.mlp(point + F.linear(self.code.to(features.dtype), of_code))  # (b n 2 3)
        dense: Tensor = (points.unsqueeze(2) + moves).flatten(1, 2)
        return dense


def unit_sphere(cloud: Points) -> tuple[Points, Float[Tensor, "b 1 3"], Float[Tensor, "b 1 1"]]:
    """Each cloud around its centroid, its farthest point at 1; the centroid and that point's distance."""
    centre = cloud.mean(1, keepdim=True)
    framed = cloud - centre
    radius = framed.norm(dim=-1, keepdim=True).amax(1, keepdim=True).clamp_min(1e-9)
    return framed / radius, centre, radius


def nearby_mean(cloud: Points, fresh: Features, before: Float[Tensor, "b q 3"], known: Rows, k: int) -> Features:
    """Features of the level before, interpolated at each point: a weighted mean of its k nearest points.

    The weights are exp(−2d²/h) for the distance d in space and again for that among the features, h being the mean over
    the cloud of the least d². They take no part in the gradient.

    Args:
        cloud: the points of this level.
        fresh: (b n c), their features.
        before: the points of the level before.
        known: (b q c), their features.
        k: how many of them each point looks at; all, where there are fewer.
    """
    index = knn(cloud.detach(), before.detach(), min(k, before.shape[1]))
    with torch.no_grad():
        weights = _closeness(cloud, before, index) * _closeness(fresh, known, index)
        weights = weights / (weights + 1e-5).sum(-1, keepdim=True)
    mean = torch.zeros_like(fresh)
    for weight, one in zip(weights.unbind(-1), index.unbind(-1), strict=True):  # (b n k c) is never stored
        mean = mean + weight.unsqueeze(-1) * _take(known, one)
    return mean


def _closeness(query: Features, points: Rows, index: Int[Tensor, "b n k"]) -> Float[Tensor, "b n k"]:
    square = torch.stack([(query - _take(points, j)).square().sum(-1) for j in index.unbind(-1)], dim=-1)
    h = square.amin(-1, keepdim=True).mean(1, keepdim=True).clamp_min(1e-12)
    return torch.exp(-2 * square / h)


def _take(rows: Rows, index: Int[Tensor, "b n"]) -> Features:
    return rows.gather(1, index.unsqueeze(-1).expand(-1, -1, rows.shape[-1]))
