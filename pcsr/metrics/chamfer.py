"""Chamfer distance as the paper defines it (TAPSR, Sec. 4.2.1): squared, means of both directions, summed.

Not halved, not rooted: the convention of PU-GAN, PU-GCN and those after them.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr.metrics.nearest import nearest_squared


def chamfer(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """C(P, Q) = 1/|P| Σ min‖p − q‖² + 1/|Q| Σ min‖q − p‖², for each cloud of the batch; differentiable.

    In the square of the coordinates' unit.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> prediction, target = torch.zeros(1, 2, 3), torch.tensor([[[0.0, 0, 0], [2, 0, 0]]])
        >>> pcsr.metrics.chamfer(prediction, target)
        tensor([2.])
    """
    return nearest_squared(prediction, target).mean(1) + nearest_squared(target, prediction).mean(1)
