"""LocalFrames: neighbourhoods by lengths and angles."""

import gc
import weakref

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError
from pcsr_plugins.layers.local_frames import SCALARS, LocalFrames, plane
from pcsr_plugins.layers.spacing import LEAST
from tests.plugins.slow_frames import curved, slow_edge, slow_frame


def close(a, b, atol=1e-9):
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


@pytest.mark.parametrize(("n", "neighbours"), [(25, 6), (25, 16), (5, 16)])
def test_frames_and_edges_are_those_of_each_point_alone(n, neighbours):
    points = curved(1, n)
    frames = LocalFrames.of(points, neighbours)
    edges = frames.edges
    k = min(neighbours, n - 1)
    assert edges.shape == (2, n, k, SCALARS)
    for b, row in enumerate(points):
        alone = [slow_frame(row, i, neighbours) for i in range(n)]
        for i, (near, offsets, unit, normal, rough) in enumerate(alone):
            assert torch.equal(frames.index[b, i], near)
            close(frames.offsets[b, i], offsets)
            close(frames.unit[b, i, 0], unit)
            close(frames.normal[b, i], normal)
            close(frames.rough[b, i, 0], rough)
            close(edges[b, i], torch.stack([slow_edge(alone[i], alone[j], offsets[s]) for s, j in enumerate(near)]))


@pytest.mark.parametrize(("neighbours", "degrees"), [(8, 2.6), (16, 2.1)])
def test_the_normal_of_a_sphere_is_its_radius_and_points_to_where_most_of_it_lies(neighbours, degrees):
    torch.manual_seed(5)
    sphere = F.normalize(torch.randn(1, 2000, 3), dim=2)
    inward = -(LocalFrames.of(sphere, neighbours).normal * sphere).sum(-1)
    off = inward.abs().clamp(max=1).acos().rad2deg().flatten()
    assert off.quantile(0.9) < degrees
    assert off.max() < 10
    assert (inward > 0).float().mean() > 0.98  # few neighbours, all on one side of the point, may seem to bend up


def test_the_normal_of_a_plane_is_exact():
    flat = torch.randn(1, 7, 9, 3)
    flat[..., 2] = 0.25 * flat[..., 0] - 0.5 * flat[..., 1]
    normal = F.normalize(torch.tensor([-0.25, 0.5, 1.0]), dim=0)
    close((plane(flat) @ normal).abs(), torch.ones(1, 7), 1e-6)


def test_an_edge_between_very_different_spacings_is_bounded():
    points = torch.cat([1e-5 * torch.randn(1, 20, 3), torch.randn(1, 20, 3)], 1)
    log_ratio = LocalFrames.of(points, 25).edges[..., 4]
    assert log_ratio.abs().max() == 3


@pytest.mark.parametrize("points", [torch.zeros(1, 20, 3), torch.ones(1, 2, 3), torch.arange(60.0).view(1, 20, 3)])
def test_points_that_coincide_or_lie_on_a_line_have_frames(points):
    frames = LocalFrames.of(points, 16)
    assert (frames.unit >= LEAST).all()
    assert frames.edges.isfinite().all()
    close(frames.normal.norm(dim=-1), torch.ones(points.shape[:2]), 1e-5)


def test_frames_have_no_gradient():
    assert not LocalFrames.of(curved().requires_grad_(), 8).edges.requires_grad


def test_a_single_point_has_no_neighbourhood():
    with pytest.raises(UserError, match="2 neighbours were asked of 1 points"):
        LocalFrames.of(torch.zeros(1, 1, 3), 16)


def test_frames_of_a_tensor_are_fitted_once_and_again_when_it_changes():
    points = curved()
    frames = LocalFrames.of(points, 6)
    assert LocalFrames.of(points, 6) is frames
    assert LocalFrames.of(points, 5) is not frames
    assert LocalFrames.of(points.clone(), 6) is not frames
    points[..., 0] *= 3
    assert not torch.equal(LocalFrames.of(points, 6).offsets, frames.offsets)


def test_frames_of_inference_are_not_those_of_training():
    points, layer = curved().float(), torch.nn.Linear(SCALARS, 1)
    with torch.inference_mode():
        LocalFrames.of(points, 6).edges  # noqa: B018
    layer(LocalFrames.of(points, 6).edges).sum().backward()
    assert layer.weight.grad is not None


def test_frames_go_with_their_tensor():
    points = curved()
    frames = weakref.ref(LocalFrames.of(points, 6))
    del points
    gc.collect()
    assert frames() is None
