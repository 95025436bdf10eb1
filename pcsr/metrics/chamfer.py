"""Chamfer distance (TAPSR, Sec. 4.2.1): the sum of the mean squared distances in both directions.

There is neither a factor of 1/2 nor a square root, as in PU-GAN, PU-GCN and later work.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr.metrics.nearest import nearest_squared


def chamfer(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """Compute the Chamfer distance of each pair of clouds; differentiable.

    C(P, Q) = 1/|P| Σ min‖p − q‖² + 1/|Q| Σ min‖q − p‖²

    Args:
        prediction: predicted clouds P.
        target: true clouds Q.

    Returns:
        Distances in the square of the coordinates' unit.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> import torch
        >>> target = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
        >>> chamfer(target + torch.tensor([0.0, 0.0, 0.5]), target)
        tensor([0.5000])
    """
    return nearest_squared(prediction, target).mean(1) + nearest_squared(target, prediction).mean(1)
