import subprocess
import sys

import pytest
import torch

from pcsr.metrics import METRICS
from pcsr.metrics import nearest as module
from pcsr.metrics.nearest import nearest, nearest_squared

DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)]


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


@pytest.mark.gpu
@pytest.mark.parametrize("batch", [1, 3])
@pytest.mark.parametrize(
    ("s", "t"), [(1, 1), (5, 7), (32, 256), (33, 257), (31, 255), (1000, 3), (3, 1000), (700, 901)]
)
@pytest.mark.parametrize("kind", ["anywhere", "on a lattice, where distances are equal", "all in one place"])
def test_the_kernel_agrees_with_looking_at_every_distance(batch, s, t, kind):
    from pcsr.metrics.nearest_cuda import QUERIES, TARGETS, nearest_cuda

    assert (QUERIES, TARGETS) == (32, 256), "the sizes above are beside these"
    random = torch.Generator("cuda").manual_seed(s)
    source, target = (torch.randn(batch, n, 3, device="cuda", generator=random) for n in (s, t))
    if kind != "anywhere":
        source, target = (cloud.round() * (kind != "all in one place") for cloud in (source, target))
    squared = sum((source[:, :, None, axis] - target[:, None, :, axis]).square() for axis in range(3))
    index = nearest_cuda(source, target)
    assert index.dtype == torch.int64
    if kind == "anywhere":  # the last digit of a distance may differ, and with it the winner of a near tie
        met = squared.gather(2, index.unsqueeze(2)).squeeze(2)
        torch.testing.assert_close(met, squared.amin(2), rtol=1e-6, atol=0)
        assert (index == squared.argmin(2)).float().mean() > 0.999
    else:  # of equally near ones the first, across blocks too
        first = (squared == squared.amin(2, keepdim=True)).int().argmax(2)
        assert torch.equal(index, first)


@pytest.mark.gpu
def test_the_kernel_takes_any_layout_and_precision():
    from pcsr.metrics.nearest_cuda import nearest_cuda

    source, target = torch.randn(2, 3, 40, device="cuda").mT, torch.randn(2, 90, 6, device="cuda")[..., ::2]
    plain = nearest_cuda(source.contiguous(), target.contiguous())
    assert torch.equal(nearest_cuda(source, target), plain)
    assert torch.equal(nearest_cuda(source.double(), target.double()), plain)
    assert torch.equal(nearest(source.clone().requires_grad_(), target), plain)


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
    assert all("the same number of clouds, (b n 3) and (b m 3), got" in line for line in said)
