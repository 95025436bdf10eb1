"""The joint loss of PU-Net: points near their own true point, and apart from each other.

Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, in the form of its code: 100 times the mean
over points *and* coordinates of the squared difference to the matched true point, and the repulsion once. The clouds
are patches in the unit sphere, whose radius the code divides by. Its decay of the weights by 1e-5 is left out.
"""

from typing import Literal

from jaxtyping import Float
from torch import Tensor

from pcsr import Objective
from pcsr.metrics.chamfer import chamfer
from pcsr_plugins.layers.options import Positive, Weight
from pcsr_plugins.layers.point_losses import matched_distance, repulsion


class PUNetLoss(Objective):
    """Fidelity and repulsion. Matching is slow in whole clouds: `fidelity: chamfer` is for those."""

    needs = frozenset({"ot"})

    def __init__(
        self,
        *,
        fidelity: Literal["emd", "chamfer"] = "emd",
        weight: Weight = 100.0,
        repulsion: Weight = 1.0,
        radius: Positive = 0.07,
        width: Positive = 0.03,
    ) -> None:
        super().__init__()
        self.fidelity = fidelity
        self.weight = weight
        self.repulsion = repulsion
        self.radius = radius
        self.width = width

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Two losses, weighted: the fidelity under its own name, and `repulsion`."""
        if self.fidelity == "emd":
            near = matched_distance(prediction, target, squared=True) / 3
        else:
            near = chamfer(prediction, target)
        apart = repulsion(prediction, radius=self.radius, width=self.width)
        return {self.fidelity: self.weight * near.mean(), "repulsion": self.repulsion * apart.mean()}
