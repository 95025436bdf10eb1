"""Chamfer distance as the paper defines it (TAPSR, Sec. 4.2.1): squared, means of both directions, summed.

Not halved, not rooted: the convention of PU-GAN, PU-GCN and those after them.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr.metrics.nearest import nearest


def chamfer(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """C(P, Q) = 1/|P| Σ min‖p − q‖² + 1/|Q| Σ min‖q − p‖², for each cloud of the batch; differentiable."""
    return _one_way(prediction, target) + _one_way(target, prediction)


def _one_way(source: Float[Tensor, "b s 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    index = nearest(source, target)  # which point is nearest does not change under a small step: no gradient
    met = target.gather(1, index.unsqueeze(-1).expand(-1, -1, 3))
    return (source - met).square().sum(-1).mean(1)
