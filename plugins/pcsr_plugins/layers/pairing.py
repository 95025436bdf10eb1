"""Pairs of visual and touched points, for fusions that concatenate the features of the two.

The paper pairs the i-th with the i-th, though neither cloud has an order. Along the Hilbert curves of both clouds, the
i-th step on one is paired with the i-th step on the other; a touch of m points is stretched or skipped along to n. Or
each visual point is paired with the nearest point of the touch. Either depends on the two sets alone, not on the order
in a file.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcsr import TouchBatch
from pcsr.geometry.neighbours import knn
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Points


def hilbert_pairs(touches: TouchBatch, n: int) -> Int[Tensor, "b a n"]:
    """Index, within each touch, of the point that is paired with each of the n steps along a cloud's Hilbert curve."""
    m = touches.points.shape[2]
    step = torch.arange(n, device=touches.points.device) * m // n
    return hilbert_order(touches.points)[..., step]


def nearest_pairs(points: Points, touches: TouchBatch) -> Int[Tensor, "b a n"]:
    """Index, within each touch, of the point nearest to each visual point; of a missing touch any of its points."""
    a = touches.mask.shape[1]
    touched = touches.points.masked_fill(~touches.mask[:, :, None, None], 0.0).flatten(0, 1)  # (b·a m 3)
    queries = points.unsqueeze(1).expand(-1, a, -1, -1).flatten(0, 1)  # (b·a n 3)
    return knn(queries, touched, 1).view(-1, a, points.shape[1])


def taken(values: Float[Tensor, "b a m c"], index: Int[Tensor, "b a n"]) -> Float[Tensor, "b a n c"]:
    """Values of the touched points at each index."""
    # gather, not take_along_dim: exported, that would fix the size of the batch.
    return values.gather(2, index.unsqueeze(-1).expand(-1, -1, -1, values.shape[-1]))


def pair(points: Points, touches: TouchBatch) -> Float[Tensor, "b a n c"]:
    """Feature of the touched point that each visual point is paired with along the curves, in the order of `points`."""
    features = taken(touches.features, hilbert_pairs(touches, points.shape[1]))
    rank = hilbert_order(points).argsort(-1)  # (b n): of each visual point along its curve
    return features.gather(2, rank[:, None, :, None].expand_as(features))
