import pytest
import torch

from pcsr.metrics import nearest as module
from pcsr.metrics.nearest import nearest, nearest_squared

DEVICES = [
    "cpu",
    pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")),
]


@pytest.mark.parametrize("device", DEVICES)
def test_nearest_agrees_with_looking_at_every_distance(device, monkeypatch):
    monkeypatch.setattr(module, "CHUNK", 16)
    source, target = torch.randn(2, 50, 3, device=device), torch.randn(2, 70, 3, device=device)
    squared = (source[:, :, None] - target[:, None]).square().sum(-1)
    assert torch.equal(nearest(source, target), squared.argmin(2))
    assert torch.allclose(nearest_squared(source, target), squared.min(2).values)


@pytest.mark.parametrize("device", DEVICES)
def test_small_differences_survive_far_from_the_origin(device):
    points = torch.randn(1, 50, 3, device=device) + 1000
    assert torch.equal(nearest(points, points)[0].cpu(), torch.arange(50))
    assert nearest_squared(points, points).max() == 0


def test_the_search_itself_has_no_gradient():
    source = torch.randn(1, 5, 3, requires_grad=True)
    assert not nearest(source, torch.randn(1, 5, 3)).requires_grad
    assert nearest_squared(source, torch.randn(1, 5, 3)).requires_grad
