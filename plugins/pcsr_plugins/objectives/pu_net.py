"""The joint loss of PU-Net: earth mover's distance and repulsion.

Yu et al., "PU-Net: Point Cloud Upsampling Network", CVPR 2018, in the form of its code: 100 times the mean
over points *and* coordinates of the squared difference to the matched true point, and the repulsion once. The clouds
are patches in the unit sphere, whose radius the code divides by. Its decay of the weights by 1e-5 is left out.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr import Objective
from pcsr_plugins.layers.options import Positive, Weight
from pcsr_plugins.layers.point_losses import matched_distance, repulsion


class PUNetLoss(Objective):
    """Earth mover's distance and repulsion."""

    needs = frozenset({"ot"})

    def __init__(
        self,
        *,
        weight: Weight = 100.0,
        repulsion: Weight = 1.0,
        radius: Positive = 0.07,
        width: Positive = 0.03,
    ) -> None:
        super().__init__()
        self.weight = weight
        self.repulsion = repulsion
        self.radius = radius
        self.width = width

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Two losses, weighted, named `emd` and `repulsion`."""
        matched = matched_distance(prediction, target, squared=True) / 3
        apart = repulsion(prediction, radius=self.radius, width=self.width)
        return {"emd": self.weight * matched.mean(), "repulsion": self.repulsion * apart.mean()}
