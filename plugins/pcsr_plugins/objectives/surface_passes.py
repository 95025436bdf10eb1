"""The objective `surface` for two passes, and for predicted errors. Our own.

`pcsr upsample` makes a cloud dense in passes, and from the second on most points of the input are the network's own.
The second pass is thus trained on patches of what the first generated.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from pcsr import Objective, TouchBatch, UserError
from pcsr.contracts import UpsamplingNetwork
from pcsr.tensors import Points
from pcsr_plugins.layers.next_pass import CORE, GROWTH, next_pass
from pcsr_plugins.layers.options import Weight
from pcsr_plugins.layers.surface_distances import coverage, distances

RATE = 8
"""Rate of a pass in training: that of the last pass of `pcsr upsample` (`pcsr.upsample.dense.LAST_RATE`)."""
KEPT = 0.5
"""Candidates that cover the truth, in true points: with more of them, each could stay close to where it came from."""
FAR = 0.03
"""Distance to the plane, in radii, beyond which its loss grows linearly, not with its square (Huber): a third of the
spacing of 512 points. A few candidates between two sheets would else outweigh all others."""
LARGEST = 1.0
"""Largest error that a prediction is trained on, in radii."""


class SurfacePasses(Objective):
    """Coverage, distance to the surface and stray points of two passes, and the mismatch of predicted errors."""

    def __init__(self, *, surface: Weight = 2.0, stray: Weight = 10.0, error: Weight = 0.003) -> None:
        """Choose what counts how much, beside a weight of 1 for the coverage.

        Args:
            surface: of the squared distance to the plane, linear beyond `FAR`.
            stray: of the squared distance beyond the truth's spacing.
            error: of the absolute difference between predicted and true errors.
        """
        super().__init__()
        self.surface, self.stray, self.error = surface, stray, error

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchBatch | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """Compute the losses `coverage`, `surface`, `stray` and `error` of the first pass and of the second.

        Args:
            network: of an upsampler that predicts errors.
            points: sparse clouds, (b n 3).
            truth: evenly sampled true clouds, (b g 3).
            rate: of the recipe; both passes are at `RATE`.
            touches: touches of the clouds. The second pass gets none.

        Raises:
            UserError: the upsampler predicts no errors, or the truth is a single point.
        """
        few = round(KEPT * truth.shape[1])
        losses, dense = self._pass(network, points, truth, truth, touches, few)
        around, near, covered = next_pass(points, dense, truth)
        second, _ = self._pass(network, around, near, covered, None, few // GROWTH, core=CORE)
        return losses | {f"second {name}": loss for name, loss in second.items()}

    def _pass(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        covered: Float[Tensor, "b h 3"],
        touches: TouchBatch | None,
        few: int,
        core: float = 1.0,
    ) -> tuple[dict[str, Float[Tensor, ""]], Float[Tensor, "b n m 3"]]:
        """Return the losses of a pass, and what was generated from each of the points, without gradient.

        Of the candidates, those of the first share `core` of the points are compared with the surface, and `few` random
        ones cover the truth.
        """
        cloud, features = network.refine(points, touches)
        dense, predicted = network.upsampler.with_errors(cloud, features, RATE)
        if predicted is None:
            kind = type(network.upsampler).__name__
            raise UserError(
                f"objective 'surface-passes' trains predicted errors, and upsampler {kind} has none: take objective "
                f"'surface', or an upsampler with predicted errors, such as 'rated-edges'"
            )
        judged = round(core * cloud.shape[1]) * dense.shape[1] // cloud.shape[1]
        height, beyond = distances(dense[:, :judged], truth)
        true = (height.detach().square() + beyond.detach().square()).sqrt().clamp_max(LARGEST)
        kept = torch.randperm(dense.shape[1], generator=torch.Generator().manual_seed(0))[:few]
        losses = {
            "coverage": coverage(dense[:, kept.to(dense.device)], covered),
            "surface": self.surface * 2 * F.huber_loss(height, torch.zeros_like(height), delta=FAR),
            "stray": self.stray * beyond.square().mean(),
            "error": self.error * (predicted[:, :judged] - true).abs().mean(),
        }
        return losses, dense.detach().view(len(dense), cloud.shape[1], -1, 3)[:, : points.shape[1]]
