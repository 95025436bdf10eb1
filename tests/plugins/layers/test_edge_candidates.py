"""Rings of candidates around points, as upsamplers share them."""

import torch

from pcsr import Widths
from pcsr_plugins.layers.edge_candidates import FARTHEST, EdgeCandidates
from pcsr_plugins.layers.local_frames import LocalFrames
from tests.plugins.slow_frames import curved


@torch.no_grad()
def test_untrained_rings_lie_on_the_edges_at_growing_shares_with_the_last_hidden_layer():
    points = curved()
    features = torch.randn(2, 60, 5, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    part = EdgeCandidates(Widths(refined=5), hidden=8, spokes=6).double()
    frames = LocalFrames.of(points, 16)
    rings = list(part.rings(frames, points, features, rate=9))
    assert len(rings) == 3, "2 · 9 candidates on 6 edges"
    for number, (candidates, hidden) in enumerate(rings, 1):
        assert candidates.shape == (2, 60, 6, 3)
        assert hidden.shape == (2, 60, 6, 8)
        share = (candidates - points.unsqueeze(2)) / (rings[-1][0] - points.unsqueeze(2))
        torch.testing.assert_close(share, torch.full_like(share, number / 3), atol=1e-9, rtol=0)
    reach = (rings[-1][0] - points.unsqueeze(2)).norm(dim=-1) / FARTHEST
    near = torch.cdist(points, points)
    assert all(torch.isclose(near[b, i], reach[b, i, s]).any() for b in range(2) for i in range(60) for s in range(6))
