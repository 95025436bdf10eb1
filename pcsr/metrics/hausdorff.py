"""Hausdorff distance in its two conventions: the textbook's, and the one that upsampling papers report."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr.metrics.nearest import nearest_squared


def hausdorff(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """The greatest distance from a point of either cloud to the other cloud. Not squared.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> prediction, target = torch.zeros(1, 2, 3), torch.tensor([[[0.0, 0, 0], [2, 0, 0]]])
        >>> pcsr.metrics.hausdorff(prediction, target)
        tensor([2.])
    """
    there, back = _greatest_squared(prediction, target)
    return torch.maximum(there, back).sqrt()


def hausdorff_pugcn(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b t 3"]) -> Float[Tensor, " b"]:
    """Sum of the two directions' greatest squared distances.

    What the evaluation scripts of PU-GAN, PU-GCN, Dis-PU, Grad-PU and others compute under the name of
    Hausdorff distance.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.

    Examples:
        >>> prediction, target = torch.zeros(1, 2, 3), torch.tensor([[[0.0, 0, 0], [2, 0, 0]]])
        >>> pcsr.metrics.hausdorff_pugcn(prediction, target)
        tensor([4.])
    """
    there, back = _greatest_squared(prediction, target)
    return there + back


def _greatest_squared(
    a: Float[Tensor, "b p 3"], b: Float[Tensor, "b t 3"]
) -> tuple[Float[Tensor, " b"], Float[Tensor, " b"]]:
    return nearest_squared(a, b).amax(1), nearest_squared(b, a).amax(1)
