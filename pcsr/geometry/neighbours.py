"""Nearest neighbours inside a network, and the two things networks do with them."""

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import embedding_bag

from pcsr.errors import UserError


def knn(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    """Indices of the k points nearest to each query, nearest first. A query among the points finds itself.

    Brute force: for the hundreds of points that a network sees it beats a tree, runs on every device and
    exports. Distances are the plain differences squared, since the usual expansion |a|²+|b|²−2ab loses
    the small ones to rounding.

    Raises:
        UserError: there are fewer than k points.
    """
    if k > points.shape[1]:
        raise UserError(
            f"{k} neighbours were asked of {points.shape[1]} points: give the network more points, "
            f"or build it with fewer neighbours"
        )
    with torch.no_grad():
        distance = torch.cdist(query, points, compute_mode="donot_use_mm_for_euclid_dist")
        return distance.topk(k, dim=-1, largest=False, sorted=True).indices


def gather(features: Float[Tensor, "b n c"], index: Int[Tensor, "b q k"]) -> Float[Tensor, "b q k c"]:
    """The features at each index."""
    b, q, k = index.shape
    flat = index.reshape(b, q * k, 1).expand(-1, -1, features.shape[-1])
    return features.gather(1, flat).view(b, q, k, -1)


def neighbour_max(features: Float[Tensor, "b n c"], index: Int[Tensor, "b q k"]) -> Float[Tensor, "b q c"]:
    """The greatest value of each channel among a point's neighbours: ``gather(features, index).amax(2)``.

    An embedding bag does that without making `(b q k c)`, and remembers only who won: a third of the time,
    forward and backward together. Of equal values one gets the gradient.
    """
    if torch.compiler.is_exporting():
        return gather(features, index).amax(2)
    b, n, c = features.shape
    start = torch.arange(b, device=index.device).view(b, 1, 1) * n
    bags = (index + start).view(-1, index.shape[-1])
    return embedding_bag(bags, features.reshape(b * n, c), mode="max").view(b, -1, c)
