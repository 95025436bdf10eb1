"""The nearest point of one cloud for each point of another: what most metrics are made of."""

import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.errors import RunError

CHUNK = 1024
"""Queries compared at once on a GPU: CHUNK × t distances are held in memory."""


@torch.no_grad()
def nearest(source: Float[Tensor, "b s 3"], target: Float[Tensor, "b t 3"]) -> Int[Tensor, "b s"]:
    """Index of the target point nearest to each source point, exact; not differentiable.

    A k-d tree on the CPU, 100 times faster than all distances at 8192 points; all distances in chunks elsewhere.

    Raises:
        RunError: a coordinate is not finite.
    """
    for name, cloud in (("first", source), ("second", target)):
        if not torch.isfinite(cloud).all():
            raise RunError(
                f"the {name} of two compared clouds has coordinates that are not finite: if a network made it, "
                f"its training diverged; lower train.rate"
            )
    if source.device.type == "cpu":
        rows = [
            cKDTree(t.double().numpy()).query(s.double().numpy(), workers=torch.get_num_threads())[1]
            for s, t in zip(source, target, strict=True)
        ]
        return torch.stack([torch.from_numpy(row) for row in rows])
    chunks = [
        torch.cdist(part, target, compute_mode="donot_use_mm_for_euclid_dist").argmin(-1)
        for part in source.split(CHUNK, dim=1)
    ]
    return torch.cat(chunks, dim=1)
