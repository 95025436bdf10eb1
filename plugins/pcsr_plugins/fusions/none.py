"""No fusion: the raw touch points are joined to the cloud (TAPSR, Sec. 4.4, Table 4, first row).

"We removed the feature extraction and feature fusion modules and directly concatenated the tactile point
clouds." The network then sees n + a·m points; the host thins its output to rate·n points (PAPER.md).
"""

from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr import Fusion, TouchBatch, Trait, UserError, Widths
from pcsr.tensors import Features, Points


class NoFusion(Fusion):
    """Leaves the features alone; touch enters as points."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})
    uses_touch_features: ClassVar[bool] = False

    def __init__(self, widths: Widths) -> None:
        super().__init__()

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Change nothing."""
        return features

    def join(self, points: Points, touches: TouchBatch) -> Float[Tensor, "b joined 3"]:
        """Put the touched points behind the cloud's.

        Raises:
            UserError: rows of the batch hold different numbers of touches, so that their clouds would
                differ in size.
        """
        counts = touches.mask.sum(1)
        if (counts != counts[0]).any():
            name = type(self).__module__.rpartition(".")[2].replace("_", "-")
            raise UserError(
                f"fusion '{name}' joins the touches to the cloud, so one batch must hold the same number of touches "
                f"in each row, got {counts.tolist()}: group the rows by their number of touches"
            )
        return torch.cat([points, touches.points[touches.mask].view(len(points), -1, 3)], dim=1)
