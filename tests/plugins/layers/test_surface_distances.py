"""Planes of a surface, and the distances of generated points to them."""

import torch

from pcsr.metrics.nearest import nearest_squared
from pcsr_plugins.layers.surface_distances import coverage, distances, planes
from tests.plugins.surfaces import patch, sphere


def test_normals_are_those_of_the_plane_and_of_the_sphere_and_spacing_is_the_nearest_points():
    target, normal, _ = patch()
    torch.testing.assert_close((planes(target)[0] @ normal).abs(), torch.ones(1, 300), atol=1e-5, rtol=0)
    ball = sphere(n=2000).requires_grad_()
    normals, spacing = planes(ball)
    assert not normals.requires_grad
    assert not spacing.requires_grad
    off = (normals * ball).sum(-1).abs().clamp(max=1).acos().rad2deg()
    assert off.quantile(0.5) < 2
    assert off.max() < 12
    even = torch.cartesian_prod(*[torch.arange(5.0)] * 3)[None]
    torch.testing.assert_close(planes(torch.cat([even, 2 * even]))[1], torch.tensor([[1.0], [2.0]]))


def test_heights_are_signed_distances_to_the_plane_and_nothing_is_beyond_it():
    target, normal, inside = patch()
    for side in (0.05, -0.05):
        height, beyond = distances(inside + side * normal, target)
        torch.testing.assert_close(height.abs(), torch.full_like(height, 0.05), atol=1e-4, rtol=0)
        _, spacing = planes(target)
        assert (beyond <= (0.05**2 + (2 * spacing) ** 2) ** 0.5).all()


def test_coverage_is_the_mean_squared_distance_to_the_nearest_prediction():
    prediction, target = sphere(1, 40, rows=2), sphere(0, 150, rows=2)
    torch.testing.assert_close(coverage(prediction, target), nearest_squared(target, prediction).mean())
