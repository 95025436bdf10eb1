"""Coverage and accuracy as separate terms instead of the Chamfer distance. Our own.

The Chamfer distance from the new points to the true ones is for the most part the gaps between the true ones, so it
says little of whether a point lies on the surface. And where the sparse points are some of the true ones, it rewards
whoever draws new points to them. A network that learns by it comes to lie worse on smooth surfaces than interpolation
does, and less evenly (RESULTS.md, "PU-GAN's shapes"). Here the target-to-prediction term is the Chamfer term. The
prediction-to-target term is a point-to-plane distance (Chen and Medioni, "Object modelling by registration of multiple
range images", Image and Vision Computing 1992, Eq. 4) to a plane fitted around the nearest target point; beyond one
target spacing it is point-to-point. The spacing is the mean over the cloud, so the truth has to be evenly sampled.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from pcsr import Objective, UserError
from pcsr.geometry.neighbours import gather, knn
from pcsr.metrics.nearest import nearest
from pcsr.tensors import Points
from pcsr_plugins.layers.local_frames import plane
from pcsr_plugins.layers.options import Weight

AROUND = 8
"""True points that a plane is fitted to, besides the nearest."""


class Surface(Objective):
    """How well the truth is covered, and how far off its planes, and off all of it, the new points are."""

    def __init__(self, *, surface: Weight = 2.0, stray: Weight = 10.0) -> None:
        """Choose what counts how much, beside a weight of 1 for the coverage.

        Args:
            surface: of the squared distance to the plane. The more, the nearer to the surface new points lie, and the
                barer are thin limbs: a candidate between their sheets goes back to where it came from.
            stray: of the squared distance beyond the truth's spacing, the mean distance from a true point to the next.
                It needs an evenly sampled truth: of another, points on the surface between true points far apart count
                as stray.
        """
        super().__init__()
        self.surface, self.stray = surface, stray

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Three losses, named `coverage`, `surface` and `stray`.

        Raises:
            UserError: the truth is a single point, or none.
        """
        height, beyond = distances(prediction, target)
        return {
            "coverage": coverage(prediction, target),
            "surface": self.surface * height.square().mean(),
            "stray": self.stray * beyond.square().mean(),
        }


def coverage(prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b g 3"]) -> Float[Tensor, ""]:
    """Mean squared distance from each target point to the nearest predicted one."""
    back = nearest(target, prediction).unsqueeze(-1)
    return (target - gather(prediction, back).squeeze(2)).square().sum(-1).mean()


def distances(
    prediction: Float[Tensor, "b p 3"], target: Float[Tensor, "b g 3"]
) -> tuple[Float[Tensor, "b p"], Float[Tensor, "b p"]]:
    """Distance of each predicted point to the plane at the nearest target point, and to that point beyond its spacing.

    Raises:
        UserError: there are fewer than two target points.
    """
    normals, spacing = planes(target)
    there = nearest(prediction, target).unsqueeze(-1)
    offset = prediction - gather(target, there).squeeze(2)
    height = (offset * gather(normals, there).squeeze(2)).sum(-1)
    return height, F.relu((offset.square().sum(-1) + 1e-12).sqrt() - spacing)  # the root of 0 has no gradient


def planes(points: Points) -> tuple[Float[Tensor, "b n 3"], Float[Tensor, "b 1"]]:
    """The normal at each point of a dense cloud, of either sign, and how far apart its points are in the mean.

    Raises:
        UserError: there are fewer than two points.
    """
    if points.shape[1] < 2:
        raise UserError(
            f"objective 'surface' fits planes to true points and those around them, and the truth has "
            f"{points.shape[1]} in all: give it more (data.points times data.rate), or take objective 'chamfer'"
        )
    with torch.no_grad():
        index = knn(points, points, min(AROUND + 1, points.shape[1]))[..., 1:]
        offsets = gather(points, index) - points.unsqueeze(2)
        return plane(offsets), offsets[:, :, 0].norm(dim=-1).mean(1, keepdim=True)
