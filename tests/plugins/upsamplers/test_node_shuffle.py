"""`node-shuffle` (PU-GCN, Sec. 3.2): a graph convolution widens the channels, which are cut into copies."""

import pytest
import torch

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.node_shuffle import NodeShuffle
from tests.plugins.compare import close
from tests.plugins.published import small_pu_gcn
from tests.plugins.slow_edges import edge, nearest


def test_node_shuffle_cuts_a_points_channels_and_adds_the_ways_to_it():
    part = NodeShuffle(Widths(refined=10, rate=3), channels=6, hidden=7, neighbours=4)
    points, features = torch.randn(1, 12, 3), torch.randn(1, 12, 10)
    dense, reduced = part(points, features, 3), torch.relu(part.reduce(features[0]))
    assert dense.shape == (1, 36, 3)
    for i, row in enumerate(nearest(points[0], 4)):
        wide = torch.stack([edge(part.widen, reduced[i], reduced[j]) for j in row]).max(0).values
        for r in range(3):
            close(dense[0, 3 * i + r], points[0, i] + part.coordinates(wide[6 * r : 6 * r + 6]))


def test_node_shuffle_knows_only_the_graph_of_the_points_not_where_they_are():
    part = NodeShuffle(Widths(refined=10, rate=3), channels=6, hidden=7, neighbours=4)
    points, features = torch.randn(1, 12, 3), torch.randn(1, 12, 10)
    turn, shift = torch.linalg.qr(torch.randn(3, 3)).Q, torch.randn(3)
    offsets = part(points, features, 3) - points.repeat_interleave(3, dim=1)
    moved = 2 * points @ turn + shift
    close(part(moved, features, 3) - moved.repeat_interleave(3, dim=1), offsets)


def test_node_shuffle_refuses_another_rate():
    with pytest.raises(UserError, match="built for rate 4, not 2: train one for rate 2"):
        small_pu_gcn()(torch.randn(1, 30, 3), 2)
