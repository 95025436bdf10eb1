"""Nearest neighbours inside a network, and the two things networks do with them."""

import torch
from jaxtyping import Float, Int, Shaped
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.errors import UserError

__all__ = ["gather", "knn", "neighbour_max"]

CHUNK = 128
"""Queries answered at once on a CPU: what holds something for each of their neighbours stays in its cache."""
ROWS = 1024
"""Queries whose distances to all points are in memory at once."""


def knn(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    """Indices of the k points nearest to each query, nearest first. A query among the points finds itself.

    On the CPU a k-d tree for each cloud: at 512 points it takes half the time of all distances, and its memory
    grows with n alone. Elsewhere all distances, ROWS queries at a time: in space the plain differences squared, in many
    dimensions expanded into |a|² + |b|² − 2ab, in double precision, since single precision would lose the small ones
    to rounding. An exported graph has the plain differences in any number of dimensions, which takes several times as
    long.

    Raises:
        UserError: there are fewer than k points.

    Examples:
        >>> from pcsr.geometry.neighbours import knn
        >>> points = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [3, 0, 0]]])
        >>> knn(points, points, 2)
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
            return torch.stack([torch.from_numpy(cKDTree(cloud).query(asked, ranks)[1]) for asked, cloud in clouds])
        nearest = nearest_in_space if points.shape[-1] <= 3 else _nearest_by_products
        return torch.cat([nearest(part, points, k) for part in torch.split(query, ROWS, dim=1)], dim=1)


def _nearest_of_all(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    distance = torch.cdist(query, points, compute_mode="donot_use_mm_for_euclid_dist")
    return distance.topk(k, dim=-1, largest=False, sorted=True).indices


def nearest_in_space(query: Float[Tensor, "b q d"], points: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b q k"]:
    """An axis at a time: on a GPU that is an order of magnitude faster than `torch.cdist`."""
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
    """The features at each index.

    Examples:
        >>> from pcsr.geometry.neighbours import gather
        >>> gather(torch.tensor([[[1.0], [2.0], [3.0]]]), torch.tensor([[[0, 2]]])).squeeze()
        tensor([1., 3.])
    """
    b, n, c = features.shape
    start = n * torch.arange(b, device=index.device).view(b, 1, 1)
    return features.reshape(b * n, c).index_select(0, (index + start).flatten()).view(*index.shape, c)


def neighbour_max(features: Float[Tensor, "b n c"], index: Int[Tensor, "b q k"]) -> Float[Tensor, "b q c"]:
    """The greatest value of each channel among a point's neighbours: ``gather(features, index).amax(2)``.

    That would make `(b q k c)`, and keep it for the way back. Here a few queries at a time only look who wins, and
    the winners are gathered. Of equal values one gets the gradient.

    Examples:
        >>> from pcsr.geometry.neighbours import neighbour_max
        >>> neighbour_max(torch.tensor([[[1.0], [2.0], [3.0]]]), torch.tensor([[[0, 2], [0, 1]]])).squeeze()
        tensor([3., 2.])
    """
    if torch.compiler.is_exporting() or features.dtype == torch.float64:
        return gather(features, index).amax(2)
    b, n, c = features.shape
    start = torch.arange(b, device=index.device).view(b, 1, 1) * n
    near = (index + start).view(-1, index.shape[-1])
    rows = features.reshape(b * n, c)
    if not (torch.is_grad_enabled() and features.requires_grad):
        return _greatest(rows, near).view(b, -1, c)
    # An integer with the row's number behind its value: as large as the value, and the greatest says where it is from.
    bits = rows.detach().float().view(torch.int32)
    value = bits ^ (bits >> 31 & 0x7FFFFFFF)  # floats in the order of integers: the more negative, the smaller
    numbered = value.long() << 32 | torch.arange(b * n, device=rows.device).unsqueeze(1)
    return rows.gather(0, _greatest(numbered, near) & 0xFFFFFFFF).view(b, -1, c)


def _greatest(rows: Shaped[Tensor, "n c"], near: Int[Tensor, "q k"]) -> Shaped[Tensor, "q c"]:
    parts = torch.split(near, CHUNK if rows.is_cpu else len(near))
    return torch.cat([rows.index_select(0, part.flatten()).view(*part.shape, -1).amax(1) for part in parts])
