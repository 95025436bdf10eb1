"""The local spacing of a cloud: the mean distance of a point to its nearest neighbours."""

from jaxtyping import Float
from torch import Tensor

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Points

SPACED = 8
"""Number of neighbours whose mean distance is the spacing."""
LEAST = 1e-6
"""Lower bound of the spacing, where points coincide; the cloud's radius is 1."""


def spacing(points: Points) -> Float[Tensor, "b n 1"]:
    """Spacing at each point of a cloud.

    Raises:
        UserError: there is no other point.
    """
    index = knn(points, points, min(SPACED, points.shape[1] - 1) + 1)[..., 1:]
    return mean_length(gather(points, index) - points.unsqueeze(2))


def mean_length(offsets: Float[Tensor, "b n k 3"]) -> Float[Tensor, "b n 1"]:
    """Spacing from the offsets to the neighbours, nearest first; those after the first `SPACED` are ignored."""
    length: Tensor = offsets[:, :, :SPACED].norm(dim=-1).mean(-1, keepdim=True)
    return length.clamp_min(LEAST)
