"""Which touched point meets which visual point, where a fusion concatenates the two.

The paper pairs the i-th with the i-th, though neither cloud has an order. Here both are walked along their own
Hilbert curves, and the i-th step of one meets the i-th step of the other; a touch of m points is stretched or
skipped along to n. So the pairing depends on the two sets alone, not on the order in a file.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr import TouchBatch
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Points


def met(touches: TouchBatch, n: int) -> Float[Tensor, "b a n c"]:
    """For each touch, the feature of the touched point met at each of the n steps of a walk along a cloud's curve."""
    m = touches.points.shape[2]
    step = torch.arange(n, device=touches.points.device) * m // n
    index = hilbert_order(touches.points)[..., step]  # (b a n)
    # gather, not take_along_dim: exported, that would fix the size of the batch.
    return touches.features.gather(2, index.unsqueeze(-1).expand(-1, -1, -1, touches.features.shape[-1]))


def pair(points: Points, touches: TouchBatch) -> Float[Tensor, "b a n c"]:
    """The same for each visual point, in the order of `points`."""
    features = met(touches, points.shape[1])
    rank = hilbert_order(points).argsort(-1)  # (b n): of each visual point along its curve
    return features.gather(2, rank[:, None, :, None].expand_as(features))
