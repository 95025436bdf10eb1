"""The Chamfer distance, and how far the new points are off the surface. Our own.

Between clouds of 8192 points nine tenths of a Chamfer distance are the gaps between the true points: it says little of
whether a point lies on the surface, and a network that learns by it alone comes to lie worse on smooth surfaces than
interpolation does (RESULTS.md, "The loss"). So the distance to the plane of the nearest true point and those around
it counts by itself: the point-to-plane error of registration (Chen and Medioni, "Object modelling by registration of
multiple range images", Image and Vision Computing 1992, Eq. 4).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from pcsr import Objective
from pcsr.geometry.neighbours import gather, knn
from pcsr.metrics.nearest import nearest
from pcsr.tensors import Points
from pcsr_plugins.layers.frames import plane

AROUND = 8
"""True points that a plane is fitted to, besides the nearest."""


class Surface(Objective):
    """Chamfer distance plus `weight` times the mean squared distance to the nearest true plane."""

    def __init__(self, *, weight: float = 10.0) -> None:
        super().__init__()
        self.weight = weight

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Two losses, named `chamfer` and `surface`."""
        there, back = nearest(prediction, target), nearest(target, prediction)
        way = prediction - gather(target, there.unsqueeze(-1)).squeeze(2)
        gap = target - gather(prediction, back.unsqueeze(-1)).squeeze(2)
        normal = gather(normals(target), there.unsqueeze(-1)).squeeze(2)
        chamfer = way.square().sum(-1).mean() + gap.square().sum(-1).mean()
        return {"chamfer": chamfer, "surface": self.weight * (way * normal).sum(-1).square().mean()}


def normals(points: Points) -> Float[Tensor, "b n 3"]:
    """The normal at each point of a dense cloud, of either sign; without a gradient."""
    with torch.no_grad():
        near = knn(points, points, min(AROUND + 1, points.shape[1]))[..., 1:]
        return plane(gather(points, near) - points.unsqueeze(2))
