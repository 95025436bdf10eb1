import subprocess
import sys

import pytest
import torch

from pcsr.metrics import METRICS
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


def test_what_are_no_batches_of_clouds_is_said_by_every_metric():
    """In a process of its own: in this one the types say it first."""
    code = """
import torch
from pcsr import UserError
from pcsr.metrics import METRICS

for metric in METRICS.values():
    for shapes in [((9, 3), (9, 3)), ((1, 9, 4), (1, 9, 3)), ((2, 9, 3), (1, 9, 3))]:
        try:
            metric.between_clouds and metric.between_clouds(*map(torch.rand, shapes))
        except UserError as error:
            print(error)
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
    of_clouds = [metric for metric in METRICS.values() if metric.between_clouds]
    assert len(said) == 3 * len(of_clouds)
    assert all("as many clouds, (b n 3) and (b m 3), got" in line for line in said)
