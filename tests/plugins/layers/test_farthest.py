"""Farthest points of each cloud of a batch."""

import torch

from pcsr.geometry.farthest import farthest_points
from pcsr_plugins.layers.farthest import farthest


def test_farthest_points_of_fewer_are_the_first_of_more():
    points = torch.randn(2, 40, 3)
    rows = farthest(points, 20)
    assert torch.equal(farthest(points, 7), rows[:, :7])
    for b in range(2):
        assert torch.equal(rows[b], points[b, farthest_points(points[b].numpy(), 20)])
        assert farthest_points(rows[b].numpy(), 7, start=0).tolist() == list(range(7))  # a level of the level before
