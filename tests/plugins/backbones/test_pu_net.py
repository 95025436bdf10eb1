"""`pu-net`: levels of set abstraction, carried back to every point."""

import torch
from torch.nn import functional as F

from pcsr import Widths
from pcsr.geometry.farthest import farthest_points
from pcsr_plugins.backbones.pu_net import PUNet
from tests.plugins.compare import close


def test_the_backbone_gives_the_published_259_channels():
    assert PUNet(Widths(visual=64)).channels == 259


@torch.no_grad()
def test_the_backbone_is_its_levels_one_by_one():
    backbone = PUNet(Widths(visual=6), channels=(8, 12), radii=(0.5, 0.9), samples=5, reduced=4).double()
    points, features = torch.randn(2, 24, 3, dtype=torch.float64), torch.randn(2, 24, 6, dtype=torch.float64)
    for b in range(2):
        below, known, sides = points[b], features[b], [features[b], points[b]]
        for level, reduce in zip(backbone.levels, backbone.reduce, strict=True):
            start = None if len(below) == 24 else 0
            centres = below[farthest_points(below.numpy(), len(below) // 2, start)]
            known = level(centres[None], below[None], known[None])[0]
            below, carried = centres, []
            for point in points[b]:
                distance = (centres - point).square().sum(-1)
                nearest = distance.argsort()[:3]
                weights = 1 / distance[nearest].clamp_min(1e-8)
                carried.append((weights / weights.sum()) @ known[nearest])
            sides.insert(0, F.relu(reduce(torch.stack(carried))))
        close(backbone(points, features)[b], torch.cat(sides, dim=-1), 1e-5)
