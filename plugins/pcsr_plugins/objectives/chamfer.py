"""The Chamfer distance, TAPSR's only loss (Sec. 4.2.1): mean squared distances, both directions summed."""

from jaxtyping import Float
from torch import Tensor

from pcsr import Objective
from pcsr.metrics.chamfer import chamfer


class Chamfer(Objective):
    """C(P, Q) = 1/|P| Σ min‖p − q‖² + 1/|Q| Σ min‖q − p‖², averaged over the batch."""

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """One loss, named `chamfer`."""
        return {"chamfer": chamfer(prediction, target).mean()}
