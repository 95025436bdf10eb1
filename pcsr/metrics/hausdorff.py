"""Hausdorff distance in two conventions: that of textbooks, and that of papers on upsampling."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr.metrics.nearest import nearest_squared


def hausdorff(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """Compute the Hausdorff distance of each pair of clouds: the greatest distance from a point to the other cloud.

    Args:
        prediction: predicted clouds.
        target: true clouds.

    Returns:
        Distances in the coordinates' unit, not squared.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> target = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
        >>> hausdorff(target + torch.tensor([0.0, 0.0, 0.5]), target)
        tensor([0.5000])
    """
    forward, backward = _greatest_squared(prediction, target)
    return torch.maximum(forward, backward).sqrt()


def hausdorff_pugcn(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """Compute the sum of the greatest squared distances in both directions for each pair of clouds.

    The evaluation scripts of PU-GAN, PU-GCN, Dis-PU, Grad-PU and others report this value as Hausdorff distance.

    Args:
        prediction: predicted clouds.
        target: true clouds.

    Returns:
        Values in the square of the coordinates' unit.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> target = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
        >>> hausdorff_pugcn(target + torch.tensor([0.0, 0.0, 0.5]), target)
        tensor([0.5000])
    """
    forward, backward = _greatest_squared(prediction, target)
    return forward + backward


def _greatest_squared(
    a: Float[Tensor, "b p 3"], b: Float[Tensor, "b t 3"]
) -> tuple[Float[Tensor, " b"], Float[Tensor, " b"]]:
    return nearest_squared(a, b).amax(1), nearest_squared(b, a).amax(1)
