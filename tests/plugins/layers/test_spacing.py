"""The local spacing of a cloud."""

import torch

from pcsr_plugins.layers.spacing import spacing
from tests.plugins.compare import close


def test_the_spacing_is_the_mean_distance_to_eight_neighbours_or_to_all_there_are():
    points = torch.randn(2, 5, 3)
    distance = torch.cdist(points, points)
    close(spacing(points)[..., 0], distance.sum(-1) / 4)
    points = torch.randn(2, 15, 3)
    close(spacing(points)[..., 0], torch.cdist(points, points).sort().values[..., 1:9].mean(-1), 1e-4)
