"""A grafted network with the interface of pcsr's own networks, so that it is trained, measured and used like them."""

from contextlib import nullcontext
from typing import Any

import torch
from torch import Tensor

from pcsr.contracts import TouchBatch, Upsampler
from pcsr.errors import PcsrError, UserError
from pcsr.grafting.calling import dense_clouds
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import with_points
from pcsr.grafting.observation import one_line
from pcsr.random_state import seeded
from pcsr.tensors import Dense, Points

UPSAMPLER = Upsampler()
"""The upsampler of a grafted network, as far as its host looks at it: it prepares nothing, and has one rate."""


class GraftedNetwork(Grafted):
    """A grafted network as an upsampling network, Q = f(P, T)."""

    upsampler = UPSAMPLER

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.frozen:  # a network that is never trained needs no gradients of its weights
            self.network.requires_grad_(False)

    def forward(  # type: ignore[override]  # its host calls it with clouds, not with the network's arguments
        self, points: Points, rate: int, touches: TouchBatch | None = None
    ) -> Dense:
        """Upsample a batch of clouds in the unit sphere.

        Args:
            points: (b n 3).
            rate: output points for each input point.
            touches: touches in the frame of `points`; none by default.

        Returns:
            (b rate·n 3), in the same frame.

        Raises:
            UserError: the network raises an error, or gives no cloud of this size.
        """
        return self.stages(points, rate, touches)[-1]

    def stages(self, points: Points, rate: int, touches: TouchBatch | None = None) -> list[Dense]:
        """Upsample, and return the intermediate clouds among the network's outputs too: the result last."""
        if self.injection_point.smallest_batch > 1 and len(points) == 1:
            return [cloud[:1] for cloud in self.stages(points.repeat(2, 1, 1), rate, _copied(touches, 2))]
        if torch.is_inference_mode_enabled():
            # Networks that follow a gradient at inference, as that of a distance, enable it. Inference mode forbids it.
            with torch.inference_mode(False), torch.no_grad():
                return self.stages(points.clone(), rate, _copied(touches))
        cloud = points.clone() if self.injection_point.points_layout == "bnc" else points.transpose(1, 2).contiguous()
        calling = self.calling
        arguments, keywords = ((), {}) if calling is None else (calling.arguments, calling.keywords)
        args, kwargs = with_points(self.injection_point.points, cloud, arguments, keywords)
        touched = {} if touches is None else {"touches": touches.points, "mask": touches.mask}
        name = type(self.network).__name__
        exporting = torch.compiler.is_exporting()
        # Some networks sample their points from a random one on. In training the states are seeded for each step.
        fixed = nullcontext() if self.training or exporting else seeded([0], cloud.device)
        try:
            with fixed:
                result = super().forward(*args, **touched, **kwargs)
        except PcsrError:
            raise
        except (Exception, SystemExit) as error:  # foreign code may raise any error
            if exporting:  # whose own errors are part of its way of working
                raise
            text = f"{type(error).__name__}: {one_line(error)}"
            raise UserError(f"{name} fails on points of {tuple(cloud.shape)}: {text}") from error
        return dense_clouds(name, result, points.shape[0], points.shape[1], rate)

    def candidates(self, points: Points, rate: int, touches: TouchBatch | None = None) -> tuple[Dense, None]:
        """Generate points as `forward` does. Their errors are not predicted."""
        return self(points, rate, touches), None

    def refine(self, points: Points, touches: TouchBatch | None = None) -> tuple[Tensor, Tensor]:
        """Refuse objectives that need features.

        Raises:
            UserError: always.
        """
        raise UserError(
            f"the objective needs features of the network, and the graft on {type(self.network).__name__} gives clouds "
            f"alone: choose an objective of the dense cloud, such as 'chamfer'"
        )

    @property
    def parameter_count(self) -> int:
        """Number of weights."""
        return sum(p.numel() for p in self.parameters())


def _copied(touches: TouchBatch | None, times: int = 1) -> TouchBatch | None:
    """Copy the touches of a batch, `times` one after another."""
    if touches is None:
        return None
    return TouchBatch.of(touches.points.repeat(times, 1, 1, 1), touches.mask.repeat(times, 1))
