"""The pairing of visual points with those of a touch, along both Hilbert curves."""

import torch

from pcsr.geometry.ordering import hilbert_order
from pcsr_plugins.layers.hilbert_pairing import pair
from tests.plugins.small_touches import touched


def test_pairing_walks_both_curves_in_step():
    points, touches = torch.randn(2, 13, 3), touched([[True, True, True]] * 2, 5)
    met = pair(points, touches)
    for b in range(2):
        for a in range(3):
            walk = hilbert_order(touches.points)[b, a]
            for step, point in enumerate(hilbert_order(points)[b]):
                assert torch.equal(met[b, a, point], touches.features[b, a, walk[step * 5 // 13]])
