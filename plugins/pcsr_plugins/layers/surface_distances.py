"""Distances between generated points and an evenly sampled surface, for the objectives named after it."""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from pcsr import UserError
from pcsr.geometry.neighbours import gather, knn
from pcsr.metrics.nearest import nearest
from pcsr.tensors import Points
from pcsr_plugins.layers.local_frames import plane

AROUND = 8
"""True points that a plane is fitted to, besides the nearest."""


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
