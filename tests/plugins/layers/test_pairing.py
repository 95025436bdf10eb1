"""The pairing of visual points with those of a touch: along both Hilbert curves, or the nearest."""

import pytest
import torch

from pcsr import TouchBatch
from pcsr.geometry.ordering import hilbert_order
from pcsr_plugins.layers.pairing import nearest_pairs, pair, taken
from tests.plugins.small_touches import touched


def test_pairing_walks_both_curves_in_step():
    points, touches = torch.randn(2, 13, 3), touched([[True, True, True]] * 2, 5)
    met = pair(points, touches)
    for b in range(2):
        for a in range(3):
            walk = hilbert_order(touches.points)[b, a]
            for step, point in enumerate(hilbert_order(points)[b]):
                assert torch.equal(met[b, a, point], touches.features[b, a, walk[step * 5 // 13]])


@pytest.mark.parametrize("m", [1, 5, 40])
def test_nearest_pairs_are_those_of_all_distances(m):
    points, touches = torch.randn(2, 13, 3), touched([[True, True, True], [True, False, True]], m)
    index = nearest_pairs(points, touches)
    assert index.shape == (2, 3, 13)
    features = taken(touches.features, index)
    for b, a in touches.mask.nonzero().tolist():
        for i, point in enumerate(points[b]):
            nearest = min(range(m), key=lambda j: (touches.points[b, a, j] - point).norm().item())
            assert index[b, a, i] == nearest
            assert torch.equal(features[b, a, i], touches.features[b, a, nearest])


def test_a_missing_touch_that_is_not_finite_can_be_paired():
    points, touches = torch.randn(1, 6, 3), touched([[True, False]], 4)
    broken = touches.points.clone()
    broken[0, 1] = torch.nan
    index = nearest_pairs(points, TouchBatch(broken, touches.features, touches.mask))
    assert torch.equal(index[:, 0], nearest_pairs(points, touches)[:, 0])
    assert ((index >= 0) & (index < 4)).all()
