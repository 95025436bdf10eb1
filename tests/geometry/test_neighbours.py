import subprocess
import sys
from pathlib import Path

import pytest
import torch

from pcsr import UserError
from pcsr.geometry.neighbours import CHUNK, ROWS, gather, knn, nearest_in_space, neighbour_max


@pytest.mark.parametrize("d", [2, 3, 5])
@pytest.mark.parametrize(("q", "k"), [(7, 5), (7, 1), (2 * ROWS + 1, 3)])
def test_knn_agrees_with_sorting_every_distance(d, q, k):
    generator = torch.Generator().manual_seed(d)
    query, points = torch.randn(2, q, d, generator=generator), torch.randn(2, 30, d, generator=generator)
    distances = (query[:, :, None] - points[:, None]).double().square().sum(-1)
    assert torch.equal(knn(query, points, k), distances.argsort(-1)[..., :k])


@pytest.mark.parametrize("d", [3, 40])
@pytest.mark.parametrize("away", [0.0, 1e3])
def test_knn_in_any_number_of_dimensions_tells_near_points_apart(d, away):
    """Wherever the cloud is, and though two of its clusters are a million times as far apart as their points are."""
    generator = torch.Generator().manual_seed(d)
    points = torch.randn(2, 60, d, generator=generator)
    points[:, ::2] = 4 + 1e-4 * points[:, ::2]
    points[:, 1::2] *= 1e-4
    points = points + away
    distances = (points[:, :, None] - points[:, None]).double().square().sum(-1)
    near = knn(points, points, 8)
    torch.testing.assert_close(distances.gather(2, near), distances.sort(-1).values[..., :8], rtol=1e-5, atol=1e-13)
    if not away:
        assert torch.equal(near[..., 0], torch.arange(60).expand(2, -1))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize(("q", "k"), [(1, 1), (7, 5), (200, 30)])
def test_the_search_of_a_gpu_finds_what_trees_find(d, q, k):
    generator = torch.Generator().manual_seed(10 * d + k)
    query, points = torch.randn(3, q, d, generator=generator), torch.randn(3, 30, d, generator=generator)
    kept = query.clone(), points.clone()
    assert torch.equal(nearest_in_space(query, points, k), knn(query, points, k))
    assert all(torch.equal(now, before) for now, before in zip((query, points), kept, strict=True)), "inputs stay"
    own = nearest_in_space(points, points, 3)
    assert torch.equal(own[..., 0], torch.arange(30).expand(3, -1))


def test_the_search_of_a_gpu_tells_near_points_apart_far_from_the_origin():
    generator = torch.Generator().manual_seed(0)
    points = torch.randn(2, 60, 3, generator=generator) * 1e-3 + 100
    near = nearest_in_space(points, points, 6)
    distances = (points[:, :, None] - points[:, None]).double().square().sum(-1)
    torch.testing.assert_close(distances.gather(2, near), distances.sort(-1).values[..., :6], rtol=1e-5, atol=0)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_neighbours_of_many_points_need_no_matrix_of_distances():
    """65,536 points would have 17 GB of them."""
    code = """
import resource, torch
from pcsr.geometry.neighbours import knn
points = torch.rand(1, 2**16, 3)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
knn(points, points, 16)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    more = int(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)
    assert more * 1024 < 100e6


def test_a_point_finds_itself_first_far_from_the_origin():
    points = torch.randn(1, 50, 3) * 1e-3 + 100
    assert torch.equal(knn(points, points, 3)[0, :, 0], torch.arange(50))


def test_too_few_points_is_said():
    with pytest.raises(UserError, match="20 neighbours were asked of 7 points"):
        knn(torch.zeros(1, 7, 3), torch.zeros(1, 7, 3), 20)


def test_gather_picks_rows():
    features = torch.arange(24.0).view(2, 4, 3)
    index = torch.tensor([[[0, 3]], [[2, 2]]])
    assert torch.equal(gather(features, index)[0, 0], features[0, [0, 3]])
    assert torch.equal(gather(features, index)[1, 0], features[1, [2, 2]])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.bfloat16])
@pytest.mark.parametrize("q", [11, 2 * CHUNK + 1])
def test_neighbour_max_equals_the_plain_maximum_in_value_and_gradient(q, dtype):
    generator = torch.Generator().manual_seed(q)
    index = torch.rand(2, q, 20, generator=generator).argsort(-1)[..., :6]  # each neighbour once
    a = 1e3 ** torch.randn(2, 20, 5, generator=generator) * torch.randn(2, 20, 5, generator=generator).sign()
    a = a.to(dtype).requires_grad_()
    b = a.detach().clone().requires_grad_()
    ours, plain = neighbour_max(a, index), gather(b, index).max(2).values
    weight = torch.randint_like(plain, -3, 4)  # whole numbers, which add up alike in any order
    (ours * weight).sum().backward()
    (plain * weight).sum().backward()
    assert torch.equal(ours, plain)
    assert torch.equal(neighbour_max(a.detach(), index), plain)
    if dtype != torch.bfloat16:  # there sums of whole numbers are rounded too
        assert torch.equal(a.grad, b.grad)


def test_of_equal_values_one_gets_the_gradient():
    for x in (torch.zeros(1, 4, 2), -torch.ones(1, 4, 2), torch.tensor([[[0.0, -0.0], [-0.0, 0.0]] * 2])):
        x.requires_grad_()
        neighbour_max(x, torch.arange(4).view(1, 1, 4)).sum().backward()
        assert x.grad.sum(1).tolist() == [[1.0, 1.0]]
        assert x.grad.amax().item() == 1.0
