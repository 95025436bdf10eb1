"""Touched points become part of the dense cloud, and of the input of the next pass. Our own.

The paper pairs the i-th touch feature with the i-th visual feature (Sec. 3.3), though neither order means anything, and
finds that joining the raw clouds does harm (Sec. 4.4, Table 4, first row; `none`). Here touched points replace the
points that the network generated around them, as densely as the rest of the cloud (`keeps_touched_points`); where there
is a second pass, it starts from that cloud. In training a few points of each touch join the sparse cloud, so that the
network learns of changing spacing. At inference they do not: a cloud that is many times as dense in one region has
neighbourhoods unlike those elsewhere, and lost most of what the touch had gained.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr import TouchBatch, Widths
from pcsr.geometry.ordering import hilbert_order
from pcsr.tensors import Points
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.options import Count


class JointCloud(NoFusion):
    """Without weights: what a touched point means follows from where it lies."""

    keeps_touched_points = True

    def __init__(self, widths: Widths, *, points: Count = 48) -> None:
        """Choose how many points of a touch are inserted.

        Args:
            widths: of the features, from the host.
            points: of each touch that join the cloud in training.
        """
        super().__init__(widths)
        self.points = points

    def join(self, points: Points, touches: TouchBatch) -> Float[Tensor, "b joined 3"]:
        """In training every so manieth point of each touch, along its Hilbert curve, behind the cloud's.

        Touches of no points are left out.

        Raises:
            UserError: rows of the batch hold different numbers of touches, so that their clouds would differ in size.
        """
        m = touches.points.shape[2]
        if not (self.training and m):
            return points
        some = min(self.points, m)
        step = torch.arange(some, device=points.device) * m // max(some, 1)
        index = hilbert_order(touches.points)[..., step].unsqueeze(-1)
        return super().join(points, TouchBatch.of(touches.points.gather(2, index.expand(-1, -1, -1, 3)), touches.mask))
