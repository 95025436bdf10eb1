"""The objective that trains a network, and the network as the objective receives it.

b is the number of clouds in a batch, n of points in a cloud, c of channels. All coordinates are in the frame in which
the sparse cloud fills the unit sphere.
"""

from typing import ClassVar, Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts.network import Upsampler
from pcsr.contracts.part import Part
from pcsr.contracts.touch_batch import TouchBatch
from pcsr.tensors import Dense, Points


@runtime_checkable
class UpsamplingNetwork(Protocol):
    """A complete network, as `Objective.losses` receives it.

    Examples:
        >>> isinstance(pcsr.load("tapsr").network, pcsr.UpsamplingNetwork)
        True
    """

    upsampler: Upsampler

    def __call__(self, points: Points, rate: int, touches: TouchBatch | None = None) -> Dense:
        """Upsample sparse clouds (b n 3) to dense clouds (b rate·n 3)."""

    def stages(self, points: Points, rate: int, touches: TouchBatch | None = None) -> list[Dense]:
        """Upsample sparse clouds and return the intermediate clouds too, the result last."""

    def refine(
        self, points: Points, touches: TouchBatch | None = None
    ) -> tuple[Float[Tensor, "b joined 3"], Float[Tensor, "b joined c"]]:
        """Compute the upsampler's input: the cloud, to which the fusion may have joined touches, and its features."""


class Objective(nn.Module, Part):
    """The loss that training minimises. It may have weights of its own, such as a discriminator's.

    Override `forward` for a loss of the dense cloud alone. Override `losses` for a loss that needs the network itself.

    Examples:
        >>> class Shift(pcsr.Objective):
        ...     def forward(self, prediction, target):
        ...         return {"shift": (prediction.mean(1) - target.mean(1)).norm()}
        >>> Shift()(torch.ones(1, 4, 3), torch.ones(1, 6, 3))
        {'shift': tensor(0.)}
    """

    lr_multiplier: ClassVar[float] = 1.0
    """Learning rate of the objective's own weights, as a multiple of the network's."""

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Compare dense clouds with true ones.

        Args:
            prediction: (b r·n 3).
            target: (b g 3); g may differ from r·n.

        Returns:
            Scalar losses by name; training minimises their sum.
        """
        raise NotImplementedError

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchBatch | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """Compute the losses of a network on one batch. Training calls this method once a step.

        By default it runs the network and calls `forward`.

        Args:
            network: the network in training.
            points: sparse clouds, (b n 3).
            truth: true clouds, (b g 3).
            rate: points to generate for each point.
            touches: touches of the clouds. None: there are none.

        Returns:
            Scalar losses by name; training minimises their sum.

        Raises:
            UserError: the objective cannot be used with this network; the message names the part.
        """
        losses: dict[str, Float[Tensor, ""]] = self(network(points, rate, touches), truth)
        return losses
