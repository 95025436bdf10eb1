"""Farthest points of each cloud of a batch, for networks that work on fewer and fewer points."""

import torch
from jaxtyping import Float

from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.neighbours import gather
from pcsr.tensors import Points


def farthest(points: Points, count: int) -> Float[torch.Tensor, "b count 3"]:
    """The `count` farthest points of each cloud, each the one farthest from all before it.

    So the first of them are the farthest points of all of them: one call serves every level of a hierarchy. Which
    points are taken does not depend on their order, and is found on the CPU.

    Raises:
        UserError: there are fewer than `count` points.
    """
    clouds = points.detach().cpu().numpy()
    index = torch.stack([torch.from_numpy(farthest_points(cloud, count)) for cloud in clouds])
    return gather(points, index.to(points.device).unsqueeze(1)).squeeze(1)
