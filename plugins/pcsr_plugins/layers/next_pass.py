"""Patches of generated clouds, as training data of the next pass of a network. Our own."""

import math

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.spread_out import spread_out
from pcsr.tensors import Points

GROWTH = 4
"""Points of the next pass for each point, as in `pcsr.upsample.dense`."""
MARGIN = 1.4
"""Points that a patch is chosen from, in points of the patch: those at the border lack neighbours."""
BORDER = 1.3
"""True points around a patch that the distance from the surface is measured to, in true points of the patch."""
CORE = 0.6
"""Share of a patch, around its centre, whose candidates are judged. Those at the border would be judged by their
distance from the surface alone, as no true points are to be covered there, and so learn to stay where they are."""
COVERED = 0.5
"""True points that are to be covered, in true points of the patch: those within reach of the core."""


def next_pass(
    points: Points, dense: Float[Tensor, "b n m 3"], truth: Float[Tensor, "b g 3"]
) -> tuple[Points, Float[Tensor, "b h 3"], Float[Tensor, "b c 3"]]:
    """Cut a patch of as many points as the cloud has from the cloud after the next pass.

    Args:
        points: sparse clouds, (b n 3).
        dense: what was generated from each of their points, without gradient; the last of them farthest away.
        truth: true clouds, (b g 3).

    Returns:
        The patches in their own unit spheres, (b n 3), nearest to the centre first, the first `CORE` of which are the
        core; true points around them, (b h 3); and those of the true points that the patches must cover, (b c 3).
    """
    rows = [_patch(*each) for each in zip(points, dense, truth, strict=True)]
    around, near, covered = (torch.stack(clouds).to(points) for clouds in zip(*rows, strict=True))
    return around, near, covered


def _patch(
    points: Float[Tensor, "n 3"], dense: Float[Tensor, "n m 3"], truth: Float[Tensor, "g 3"]
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "h 3"], Float[Tensor, "c 3"]]:
    n = len(points)
    middle = points[0]  # the order of the points is random
    some = min(n, math.ceil(MARGIN * n / GROWTH))
    rows = (points - middle).norm(dim=1).topk(some, largest=False).indices
    cloud, candidates = points[rows].cpu().numpy(), dense[rows, -GROWTH * 2 :].flatten(0, 1).cpu().numpy()
    away = cKDTree(cloud).query(candidates)[0]
    chosen = spread_out(candidates, away, np.zeros(len(candidates), np.int64), np.array([(GROWTH - 1) * some]))
    grown = torch.from_numpy(np.concatenate([cloud, candidates[chosen]]))
    patch = grown[(grown - middle.cpu()).norm(dim=1).topk(min(n, len(grown)), largest=False).indices]
    sphere = UnitSphere.fit(patch.numpy())
    count = min(len(truth), round(BORDER * len(truth) / GROWTH))
    near = truth[(truth - middle).norm(dim=1).topk(count, largest=False).indices].cpu()
    around, true = (torch.from_numpy(sphere.normalize(cloud.numpy())) for cloud in (patch, near))
    return around, true, true[: max(1, round(COVERED * len(truth) / GROWTH))]
