"""Grad-PU's objective: error of predicted distances to the surface.

He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with Learned Distance Functions",
CVPR 2023, Sec. 3.3. Queries are the interpolated points with noise of 0.02 radii; the predicted distance there is
compared with that to the nearest point of the truth: L1, summed over the queries, averaged over the batch.
"""

from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor

from pcsr import Objective, TouchBatch, UpsamplingNetwork, UserError
from pcsr.geometry.neighbours import gather
from pcsr.metrics.nearest import nearest
from pcsr.tensors import Dense, Points
from pcsr_plugins.layers.distance_regressor import DistanceRegressor


class GradPU(Objective):
    """Absolute error of the distances that the upsampler `descent` predicts."""

    calls: Tensor
    """Batches so far: the noise follows from it alone, and it is kept with the weights, so a run that stopped and went
    on has the noise of one that never stopped."""

    def __init__(self, *, sigma: Annotated[float, Field(ge=0, le=1e6)] = 0.02) -> None:
        super().__init__()
        self.sigma = sigma
        self.register_buffer("calls", torch.zeros((), dtype=torch.int64))

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchBatch | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """One loss, named `distance`.

        Raises:
            UserError: the network's upsampler predicts no distances.
        """
        upsampler = network.upsampler
        if not isinstance(upsampler, DistanceRegressor):
            raise UserError(
                f"objective 'grad-pu' judges distances, and the upsampler {type(upsampler).__name__} predicts none: "
                f"set model.upsampler to descent, or train.objective to chamfer"
            )
        start = upsampler.prepare(points, rate)
        cloud, features = network.refine(start, touches)
        queries = self._noisy(start)
        predicted = upsampler.distance(queries, cloud, features)
        return {"distance": (predicted - distance(queries, truth)).abs().sum(1).mean()}

    def _noisy(self, queries: Dense) -> Dense:
        generator = torch.Generator().manual_seed(int(self.calls))
        if self.training:
            self.calls += 1
        noise = torch.randn(queries.shape, generator=generator, dtype=queries.dtype)
        return queries + self.sigma * noise.to(queries.device)


def distance(queries: Dense, truth: Float[Tensor, "b g 3"]) -> Float[Tensor, "b rn"]:
    """Distance of each query to the nearest true point."""
    met = gather(truth, nearest(queries, truth).unsqueeze(-1)).squeeze(2)
    apart: Tensor = (queries - met).norm(dim=-1)
    return apart
