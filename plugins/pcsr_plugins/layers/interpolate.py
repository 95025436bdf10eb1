"""Features at places between the points: the inverse-distance mean of the nearest three.

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
"""Added to the distance: a place that coincides with a point gets that point's features."""


def interpolate(
    places: Float[Tensor, "b q 3"], points: Points, features: Features, k: int = 3, power: int = 1
) -> Float[Tensor, "b q c"]:
    """Carry the features of `points` to `places`.

    A linear layer before it is the same as one after it, and there may be far fewer points than places.

    Args:
        places: where features are wanted.
        points: where there are features.
        features: those of `points`.
        k: how many points each place looks at.
        power: of the distance by which a point weighs less; 1 or 2 as a rule.

    Raises:
        UserError: there are fewer than k points.
    """
    return mix(features, *inverse_distance(places, points, k, power))


def inverse_distance(
    places: Float[Tensor, "b q 3"], points: Points, k: int = 3, power: int = 1
) -> tuple[Int[Tensor, "b q k"], Float[Tensor, "b q k"]]:
    """The k points nearest to each place, nearest first, and how much each of them weighs; the weights' sum is 1.

    The weights have a gradient by the places: hand in `places.detach()` where it isn't wanted.

    Raises:
        UserError: there are fewer than k points.
    """
    near = knn(places.detach(), points.detach(), k)
    square = (gather(points, near) - places.unsqueeze(2)).square().sum(-1)
    apart = square.clamp_min(TINY**2).sqrt()  # where both coincide a norm has a gradient, but the gradient has none
    closeness = 1 / (apart**power + TINY)
    return near, closeness / closeness.sum(-1, keepdim=True)


def mix(features: Features, near: Int[Tensor, "b q k"], weights: Float[Tensor, "b q k"]) -> Float[Tensor, "b q c"]:
    """The weighted sum of the features at each place's points; the (b q k c) of them are never made."""
    b, n, c = features.shape
    start = n * torch.arange(b, device=near.device).view(b, 1, 1)
    rows = features.reshape(b * n, c).to(weights.dtype)
    k = near.shape[-1]
    mixed = F.embedding_bag((near + start).view(-1, k), rows, mode="sum", per_sample_weights=weights.reshape(-1, k))
    return mixed.view(b, -1, c)
