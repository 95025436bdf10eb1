"""Dis-PU's objective: Chamfer distance of the coarse and the refined cloud, the latter with a growing weight.

Li et al., "Point Cloud Upsampling via Disentangled Refinement", CVPR 2021, Sec. 3.4; weights as in its code::

    1000·CD(coarse) + w·1000·CD(fine) + repulsion(fine),  w = 0.01, 0.1, 0.5, 1

The paper raises w while training goes on; the code does so every 10 of 401 epochs, each of some 857 batches. An
objective sees batches, not epochs: it counts those it trains on, in a buffer, so that a run that is taken up
again goes on where it stood. There is no decay of the weights (1e-5 in the code).
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor

from pcsr import Objective, TouchBatch, UpsamplingNetwork
from pcsr.metrics.chamfer import chamfer
from pcsr.tensors import Points
from pcsr_plugins.layers.options import Weight
from pcsr_plugins.layers.point_losses import hinge_repulsion

WEIGHTS = (0.01, 0.1, 0.5, 1.0)
"""The weight of the refined cloud, one after the other."""


class DisPU(Objective):
    """Judges all stages of an upsampler; of one without any the result alone, as it judges the refined cloud."""

    counted: Tensor

    def __init__(
        self,
        *,
        distance_weight: Weight = 1000.0,
        repulsion_weight: Weight = 1.0,
        ramp: Annotated[int, Field(ge=1, le=1_000_000_000)] = 8570,
    ) -> None:
        super().__init__()
        self.distance_weight = distance_weight
        self.repulsion_weight = repulsion_weight
        self.ramp = ramp
        self.register_buffer("counted", torch.zeros((), dtype=torch.long))

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """The refined cloud's two terms, with the weight that holds now."""
        weight = self.weight * self.distance_weight
        return {
            "fine": weight * chamfer(prediction, target).mean(),
            "repulsion": self.repulsion_weight * hinge_repulsion(prediction).mean(),
        }

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchBatch | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """All stages' terms; counts the batch."""
        *coarse, fine = network.stages(points, rate, touches)
        losses: dict[str, Tensor] = self(fine, truth)
        if coarse:
            apart = torch.stack([chamfer(cloud, truth).mean() for cloud in coarse])
            losses["coarse"] = self.distance_weight * apart.sum()
        if self.training and torch.is_grad_enabled():
            self.counted += 1
        return losses

    @property
    def weight(self) -> float:
        """The refined cloud's weight: the next one after every `ramp` batches."""
        return WEIGHTS[min(int(self.counted) // self.ramp, len(WEIGHTS) - 1)]
