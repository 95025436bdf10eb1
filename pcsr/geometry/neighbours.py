"""Nearest neighbours of points and features in a network, and gathering and max pooling over them."""

import torch
from jaxtyping import Float, Int, Shaped
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.errors import UserError

__all__ = ["gather", "knn", "neighbour_max"]

CHUNK = 128
"""Queries pooled at once on a CPU, so that the features of their neighbours stay in its cache."""
ROWS = 1024
"""Queries whose distances to all points are in memory at once."""


def knn(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    """Return the indices of the k points nearest to each query, the nearest first.

    A query that is one of the points has itself as nearest neighbour.

    In up to 3 dimensions on the CPU, k-d trees are used: at 512 points they take half the time of comparing all
    distances, and their memory grows with n alone. Otherwise all distances are compared, `ROWS` queries at a time. In
    more than 3 dimensions they are expanded into |a|² + |b|² − 2ab, in double precision, since single precision would
    lose small distances to rounding. An exported graph uses plain differences instead, which takes several times as
    long.

    Raises:
        UserError: there are fewer than k points.

    Examples:
        >>> points = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]]])
        >>> knn(points, points, k=2)
        tensor([[[0, 1],
                 [1, 0],
                 [2, 1]]])
    """
    if k > points.shape[1]:
        raise UserError(
            f"{k} neighbours were asked of {points.shape[1]} points: give the network more points, "
            f"or build it with fewer neighbours"
        )
    with torch.no_grad():
        if torch.compiler.is_exporting():
            return _nearest_of_all(query, points, k)
        if points.is_cpu and points.shape[-1] <= 3:
            clouds = zip(query.double().numpy(), points.double().numpy(), strict=True)
            ranks = range(1, k + 1)
            return torch.stack([torch.from_numpy(cKDTree(cloud).query(each, ranks)[1]) for each, cloud in clouds])
        nearest = nearest_in_space if points.shape[-1] <= 3 else _nearest_by_products
        return torch.cat([nearest(part, points, k) for part in torch.split(query, ROWS, dim=1)], dim=1)


def _nearest_of_all(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    distance = torch.cdist(query, points, compute_mode="donot_use_mm_for_euclid_dist")
    return distance.topk(k, dim=-1, largest=False, sorted=True).indices


def nearest_in_space(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    """Sum squared differences axis by axis, on a GPU an order of magnitude faster than `torch.cdist`."""
    axes = zip(query.unbind(-1), points.unbind(-1), strict=True)
    distance = sum((a.unsqueeze(2) - b.unsqueeze(1)).square_() for a, b in axes)
    assert isinstance(distance, Tensor)
    return distance.topk(k, dim=-1, largest=False, sorted=True).indices


def _nearest_by_products(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    middle = points.double().mean(1, keepdim=True)
    a, b = query - middle, points - middle
    distance = torch.baddbmm(b.square().sum(-1).unsqueeze(1), a, b.mT, alpha=-2)  # |a|² is the same for all points
    return distance.topk(k, dim=-1, largest=False, sorted=True).indices


def gather(features: Float[Tensor, "b n c"], index: Int[Tensor, "b q k"]) -> Float[Tensor, "b q k c"]:
    """Gather the features at each index.

    Examples:
        >>> features = torch.tensor([[[1.0, 8.0], [5.0, 2.0], [3.0, 4.0]]])
        >>> gather(features, torch.tensor([[[0, 2]]]))
        tensor([[[[1., 8.],
                  [3., 4.]]]])
    """
    b, n, c = features.shape
    start = n * torch.arange(b, device=index.device).view(b, 1, 1)
    return features.reshape(b * n, c).index_select(0, (index + start).flatten()).view(*index.shape, c)


def neighbour_max(features: Float[Tensor, "b n c"], index: Int[Tensor, "b q k"]) -> Float[Tensor, "b q c"]:
    """Compute the maximum of each channel over neighbours, like ``gather(features, index).amax(2)``.

    The latter would keep a tensor (b q k c) for the backward pass. This function finds the neighbour with the maximum
    for a few queries at a time, and gathers these values only. Among equal values, one receives the gradient.

    Examples:
        >>> features = torch.tensor([[[1.0, 8.0], [5.0, 2.0], [3.0, 4.0]]])
        >>> neighbour_max(features, torch.tensor([[[0, 2]]]))
        tensor([[[3., 8.]]])
    """
    if torch.compiler.is_exporting() or features.dtype == torch.float64:
        return gather(features, index).amax(2)
    b, n, c = features.shape
    start = torch.arange(b, device=index.device).view(b, 1, 1) * n
    neighbours = (index + start).view(-1, index.shape[-1])
    rows = features.reshape(b * n, c)
    if not (torch.is_grad_enabled() and features.requires_grad):
        return _greatest(rows, neighbours).view(b, -1, c)
    # 64-bit integers with the value in the upper half and the row's index in the lower one: the maximum contains the
    # index of the row that it comes from.
    bits = rows.detach().float().view(torch.int32)
    value = bits ^ (bits >> 31 & 0x7FFFFFFF)  # integers in the order of the floats
    numbered = value.long() << 32 | torch.arange(b * n, device=rows.device).unsqueeze(1)
    return rows.gather(0, _greatest(numbered, neighbours) & 0xFFFFFFFF).view(b, -1, c)


def _greatest(rows: Shaped[Tensor, "n c"], neighbours: Int[Tensor, "q k"]) -> Shaped[Tensor, "q c"]:
    parts = torch.split(neighbours, CHUNK if rows.is_cpu else len(neighbours))
    return torch.cat([rows.index_select(0, part.flatten()).view(*part.shape, -1).amax(1) for part in parts])
