"""Set abstraction: a small PointNet on each ball, one ball at a time."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn import functional as F

from pcsr_plugins.layers.set_abstraction import SetAbstraction, ball
from tests.plugins.compare import close, same_gradients


@given(seed=st.integers(0, 10_000), n=st.integers(1, 30), samples=st.integers(1, 12), radius=st.floats(0.1, 3))
def test_a_ball_is_the_nearest_within_the_radius_filled_up_by_the_nearest(seed, n, samples, radius):
    generator = torch.Generator().manual_seed(seed)
    points, centres = torch.randn(1, n, 3, generator=generator), torch.randn(1, 4, 3, generator=generator)
    found, most = ball(centres, points, radius, samples)[0], 1
    for i, centre in enumerate(centres[0]):
        distance = (points[0] - centre).norm(dim=-1)
        order = distance.argsort()
        inside = [int(j) for j in order if distance[j] < radius][:samples] or [int(order[0])]
        most = max(most, len(inside))
        assert sorted(set(found[i].tolist())) == sorted(inside)
    assert found.shape[1] == most


@pytest.mark.parametrize("featured", [False, True])
def test_set_abstraction_is_a_pointnet_on_each_ball_forward_and_backward(featured):
    layer = SetAbstraction(6 if featured else 0, (8, 8, 5), radius=0.9, samples=4).double()
    points = torch.randn(2, 20, 3, dtype=torch.float64, requires_grad=True)
    centres = torch.randn(2, 7, 3, dtype=torch.float64, requires_grad=True)
    features = torch.randn(2, 20, 6, dtype=torch.float64, requires_grad=True) if featured else None
    rows = []
    for b in range(2):
        for centre in centres[b]:
            distance = (points[b] - centre).norm(dim=-1)
            order = distance.argsort()
            inside = [j for j in order if distance[j] < 0.9][:4] or order[:1]
            pointnet = []
            for j in inside:
                x = torch.cat([points[b, j] - centre, features[b, j]]) if featured else points[b, j] - centre
                for linear in (layer.first, *layer.others):
                    x = F.relu(linear(x))
                pointnet.append(x)
            rows.append(torch.stack(pointnet).amax(0))
    plain = torch.stack(rows).view(2, 7, 5)
    fast = layer(centres, points, features)
    close(fast, plain, 1e-9)
    wanted = (points, centres, *layer.parameters(), *([features] if featured else []))
    same_gradients(fast, plain, wanted, atol=1e-9, rtol=0)
