"""Interpolation of features at query points: the inverse-distance mean of the nearest three.

Qi et al., "PointNet++", NeurIPS 2017, Eq. 2, which weighs by the squared distance (PU-Net does); Grad-PU (He et al.,
CVPR 2023) weighs by the distance itself.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional as F

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Features, Points

TINY = 1e-8
"""Added to the distance: a query that coincides with a point gets that point's features."""


def interpolate(
    queries: Float[Tensor, "b q 3"], points: Points, features: Features, k: int = 3, power: int = 1
) -> Float[Tensor, "b q c"]:
    """Interpolate the features of `points` at `queries`.

    It commutes with a linear layer, which is cheaper before it where there are fewer points than queries.

    Args:
        queries: query points.
        points: those that the features are of.
        features: those of `points`.
        k: number of nearest points that are averaged.
        power: of the distance by which a point weighs less; 1 or 2 as a rule.

    Raises:
        UserError: there are fewer than k points.
    """
    return mix(features, *inverse_distance(queries, points, k, power))


def inverse_distance(
    queries: Float[Tensor, "b q 3"], points: Points, k: int = 3, power: int = 1
) -> tuple[Int[Tensor, "b q k"], Float[Tensor, "b q k"]]:
    """The k points nearest to each query, nearest first, and their weights, whose sum is 1.

    The weights have a gradient with respect to the queries: pass `queries.detach()` where it is not wanted.

    Raises:
        UserError: there are fewer than k points.
    """
    index = knn(queries.detach(), points.detach(), k)
    square = (gather(points, index) - queries.unsqueeze(2)).square().sum(-1)
    apart = square.clamp_min(TINY**2).sqrt()  # where both coincide a norm has a gradient, but the gradient has none
    closeness = 1 / (apart**power + TINY)
    return index, closeness / closeness.sum(-1, keepdim=True)


def mix(features: Features, index: Int[Tensor, "b q k"], weights: Float[Tensor, "b q k"]) -> Float[Tensor, "b q c"]:
    """Weighted sum of the features of each query's points; the (b q k c) of them are never stored."""
    b, n, c = features.shape
    start = n * torch.arange(b, device=index.device).view(b, 1, 1)
    rows = features.reshape(b * n, c).to(weights.dtype)
    k = index.shape[-1]
    mixed = F.embedding_bag((index + start).view(-1, k), rows, mode="sum", per_sample_weights=weights.reshape(-1, k))
    return mixed.view(b, -1, c)
