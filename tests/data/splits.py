"""A split of random clouds."""

import numpy as np
import torch

from pcsr.data.dataset import Split
from pcsr.geometry.frames import UnitSphere
from pcsr.recipe import Patches


def split(count: int = 7) -> Split:
    random = torch.Generator().manual_seed(1)
    truth = torch.randn(count, 40, 3, generator=random)
    return Split(
        names=[f"object {i}" for i in range(count)],
        groups=["all"] * count,
        truth=list(truth),
        points=list(truth[:, :10].clone()),
        touches=list(torch.randn(count, 3, 8, 3, generator=random)),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * count,
        covered=[(0.1, 0.2, 0.3)] * count,
        about={},
    )


def clouds(batch):
    return batch.points, batch.touches.points, batch.touches.mask, batch.truth


PATCHES = Patches.model_construct(points=5, rate=3, cover=3.0)
