"""Midpoint interpolation of a batch of clouds."""

import numpy as np
import torch

from pcsr_plugins.layers.midpoints import evenly, interpolated


def test_candidates_have_no_gradient():
    points = torch.randn(1, 20, 3, requires_grad=True)
    assert not interpolated(points, 2).requires_grad
    assert interpolated(points.double(), 2).dtype == torch.float64


def test_thinning_by_blue_noise_keeps_as_many_points_as_asked_for_each_once():
    points = np.random.default_rng(0).normal(size=(200, 3))
    kept = evenly(points, 50)
    assert len(set(kept.tolist())) == len(kept) == 50
    np.testing.assert_array_equal(evenly(points, 50), kept)
