"""Gradient descent on a learned distance function, from an interpolated cloud to the surface: Grad-PU.

He et al., "Grad-PU: Arbitrary-Scale Point Cloud Upsampling via Gradient Descent with Learned Distance Functions", CVPR
2023, Sec. 3.2 to 3.4. The cloud is interpolated by midpoints. A small regressor predicts the distance of a query to the
surface from the features of the three points nearest to it. Each new point then follows x ← x − step · ∂distance/∂x a
few times; the features stay fixed, and are interpolated at the moved points. As published the features, too, are those
of the interpolated cloud, of which patches are cut: `prepare` gives it, and it then descends at rate 1.

The authors' code takes the gradient of the *mean* over all points of all patches and multiplies it by 50, so that
a point's step falls with the number of points. Here the step is a point's own: 50 / (24 · 1024), which is what that
code takes for the field's 2048 points: 24 patches that are interpolated to 1024 points each.
"""

import itertools
from typing import Annotated

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr import Trait, Widths
from pcsr.geometry.neighbours import gather
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.distance_regressor import DistanceRegressor
from pcsr_plugins.layers.interpolate import inverse_distance, mix
from pcsr_plugins.layers.midpoints import interpolated
from pcsr_plugins.layers.options import Cascade, Positive

STEP = 50 / (24 * 1024)
"""Step in radii of the patch, for a distance whose gradient has norm 1."""
BEFORE = 0.02
"""The least distance that an untrained regressor gives: about what it is trained for."""


class Descent(DistanceRegressor):
    """Interpolates, then goes downhill."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE})

    def __init__(
        self,
        widths: Widths,
        *,
        hidden: Cascade = (64, 32, 16),
        iterations: Annotated[int, Field(ge=1, le=1000)] = 10,
        step: Positive = STEP,
        farthest: Positive = 0.2,
    ) -> None:
        super().__init__()
        self.iterations = iterations
        self.step = step
        self.farthest = farthest
        wide = (3 + widths.refined, *hidden, 1)
        self.layers = nn.ModuleList(nn.Linear(c_in, c_out) for c_in, c_out in itertools.pairwise(wide))
        # The output has a ReLU too. From half of all random weights it gives 0 everywhere, and never learns.
        weight, bias = self.layers[-1].parameters()
        nn.init.constant_(bias, BEFORE)
        with torch.no_grad():
            weight.abs_()

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Descend. At rate 1 the points are interpolated ones already; at others they are interpolated here."""
        # Of points that are equally far away the first in this order counts, not the first in the file.
        order = hilbert_order(points)
        points, features = along(order, points), along(order, features)
        return self.descend(self.prepare(points, rate), points, features)

    def prepare(self, points: Points, rate: int) -> Dense:
        """The interpolated cloud, which the network encodes and the descent starts from."""
        return points if rate == 1 else interpolated(along(hilbert_order(points), points), rate)

    def distance(self, queries: Dense, points: Points, features: Features) -> Float[Tensor, "b rn"]:
        """Predicted distance of each query to the surface, never below 0.

        Args:
            queries: (b rn 3).
            points: those that the features are of.
            features: (b n c).
        """
        return self._distance(queries, points, self._lifted(features))

    def descend(self, queries: Dense, points: Points, features: Features) -> Dense:
        """Move the queries downhill; those at distance `farthest` or more stay.

        It works wherever it is called, under `torch.no_grad` and `torch.inference_mode` too. Where gradients are
        recorded, the result has one by the features and the weights.
        """
        recorded = torch.is_grad_enabled()
        with torch.inference_mode(False), torch.enable_grad():
            queries, points, features = (_recordable(tensor) for tensor in (queries, points, features))
            lifted = self._lifted(features)
            if not recorded:
                lifted = lifted.detach()
            queries = queries.detach().requires_grad_()
            for _ in range(self.iterations):
                distance = self._distance(queries, points, lifted, twice=recorded).clamp_max(self.farthest)
                (uphill,) = torch.autograd.grad(distance.sum(), queries, create_graph=recorded)
                queries = queries - self.step * uphill
                if not recorded:
                    queries = queries.detach().requires_grad_()
        return queries if recorded else queries.detach()

    def _lifted(self, features: Features) -> Float[Tensor, "b n hidden"]:
        """First layer's part for the features, applied before these are interpolated: once for all queries."""
        weight, _ = self.layers[0].parameters()
        return F.linear(features, weight[:, 3:])

    def _distance(
        self, queries: Dense, points: Points, lifted: Float[Tensor, "b n hidden"], *, twice: bool = False
    ) -> Float[Tensor, "b rn"]:
        """`twice`: for a result that is differentiated twice; `mix` can be differentiated once only."""
        index, weights = inverse_distance(queries, points)
        read = (weights.unsqueeze(-1) * gather(lifted, index)).sum(2) if twice else mix(lifted, index, weights)
        weight, bias = self.layers[0].parameters()
        x = F.relu(F.linear(queries, weight[:, :3], bias) + read)
        for layer in self.layers[1:]:
            x = F.relu(layer(x))
        return x.squeeze(-1)


def _recordable(tensor: Tensor) -> Tensor:
    """A tensor that gradients can be recorded of: a copy, if it was created in inference mode."""
    return tensor.clone() if tensor.is_inference() else tensor
