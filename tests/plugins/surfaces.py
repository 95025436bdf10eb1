"""Samples of a sphere and of planes, for the tests of objectives and of what they share."""

import torch
from torch.nn import functional as F

from pcsr.geometry.farthest import farthest_points
from tests.plugins.slow_frames import rotation


def sphere(seed=0, n=200, rows=1):
    return F.normalize(torch.randn(rows, n, 3, generator=torch.Generator().manual_seed(seed)), dim=2)


def patch(seed=0, n=300):
    """Evenly spaced points of a plane in any orientation, its normal, and positions in it away from its borders."""
    random, turn = torch.Generator().manual_seed(seed), rotation(seed)
    flat = F.pad(2 * torch.rand(6 * n, 2, generator=random) - 1, (0, 1))
    inside = F.pad(1.4 * torch.rand(50, 2, generator=random) - 0.7, (0, 1))
    return (flat[farthest_points(flat.numpy(), n)] @ turn)[None], turn[2], (inside @ turn)[None]
