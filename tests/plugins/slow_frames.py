"""The frames of neighbourhoods one point after the other; clouds, and turns to see that nothing depends on them."""

import math

import torch
from scipy.spatial.transform import Rotation
from torch.nn import functional as F


def rotation(seed, dtype=torch.float32):
    """Any one, for rows of points: ``points @ rotation``."""
    return torch.from_numpy(Rotation.random(random_state=seed).as_matrix()).to(dtype)


def curved(seed=0, n=60, rows=2):
    """An ellipsoid, in double precision: it is certain which side is up, and rounding decides nothing."""
    random = torch.Generator().manual_seed(seed)
    directions = F.normalize(torch.randn(rows, n, 3, generator=random, dtype=torch.float64), dim=2)
    return directions * torch.tensor([1.0, 0.8, 0.6], dtype=torch.float64)


def grid(side=12):
    """A plane's, evenly spaced, (1 side² 3)."""
    line = torch.linspace(-0.6, 0.6, side, dtype=torch.float64)
    return F.pad(torch.cartesian_prod(line, line), (0, 1))[None]


def slow_frame(points, i, neighbours):
    """One point's neighbours, offsets to them in units of the spacing, the spacing, normal and roughness."""
    near = (points - points[i]).norm(dim=1).argsort()[1 : neighbours + 1]
    unit = (points[near] - points[i])[:8].norm(dim=1).mean()
    offsets = (points[near] - points[i]) / unit
    normal = torch.linalg.svd((offsets - offsets.mean(0)).double()).Vh[-1].to(points.dtype)
    normal = normal * (1 if (offsets @ normal).sum() >= 0 else -1)
    return near, offsets, unit, normal, (offsets @ normal).square().mean().sqrt()


def slow_edge(here, there, offset):
    """Features of the edge from one frame to another."""
    _, offsets, unit, normal, rough = here
    _, offsets_j, unit_j, normal_j, rough_j = there
    angles = [offset @ normal, offset @ normal_j, normal @ normal_j]
    ends = [(unit_j / unit).log(), rough_j - rough, offset @ offsets.mean(0), offset @ offsets_j.mean(0)]
    return torch.stack([offset.norm(), *angles, *ends])


def slow_around(offsets, normal, spokes):
    """Columns of a point's neighbours around it: in each sector the cheapest; empty ones take the nearest in turn."""
    spokes = min(spokes, len(offsets))
    within = [[] for _ in range(spokes)]
    for column, offset in enumerate(offsets):
        turn = torch.linalg.det(torch.stack([offsets[0], offset, normal]))
        angle = math.atan2(turn, offsets[0] @ offset - (offsets[0] @ normal) * (offset @ normal))
        cost = offset.norm() + 2 * (offset @ normal).abs()
        within[round(angle / (2 * math.pi / spokes)) % spokes].append((cost.item(), column))
    nearest = iter(range(spokes))
    return [min(those)[1] if those else next(nearest) for those in within]
