"""Which touched point meets which visual point, where a fusion concatenates the two.

The paper pairs the i-th with the i-th, though neither cloud has an order. Here both are walked along their own
Hilbert curves, and the i-th step of one meets the i-th step of the other; a touch of m points is stretched or
skipped along to n. So the pairing depends on the two sets alone, not on the order in a file.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr import Touches
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Points


def pair(points: Points, touches: Touches) -> Float[Tensor, "b a n c"]:
    """For each touch and each visual point, the feature of the touched point that it meets."""
    n, m = points.shape[1], touches.points.shape[2]
    place = hilbert_order(points).argsort(-1)  # (b n): how far along its curve each visual point lies
    met = place * m // n  # (b n)
    touched = hilbert_order(touches.points)  # (b a m)
    index = touched.gather(-1, met.unsqueeze(1).expand(-1, touched.shape[1], -1))  # (b a n)
    # gather, not take_along_dim: exported, that would fix the size of the batch.
    return touches.features.gather(2, index.unsqueeze(-1).expand(-1, -1, -1, touches.features.shape[-1]))
