"""Chamfer distance of two clouds of 8192 points, forward and backward, on two threads.

make bench ARGS=benchmarks/test_chamfer.py
"""

import pytest
import torch
from scipy.spatial import cKDTree

from pcsr.metrics import chamfer

WHAT = "chamfer 8192 × 8192, forward and backward"
ASKED = "≥ 40 × torch.cdist; ≤ 1.5 × the limit"


@pytest.fixture
def clouds():
    """Points on two spheres of slightly different radius, as a prediction and its truth."""
    rng = torch.Generator().manual_seed(0)
    a, b = torch.nn.functional.normalize(torch.randn(2, 1, 8192, 3, generator=rng), dim=-1)
    return (1.02 * a).requires_grad_(), b


def test_ours(benchmark, line, clouds):
    line(WHAT, "ours", ASKED)
    prediction, truth = clouds
    benchmark(lambda: chamfer(prediction, truth).backward())


def test_torch_cdist(benchmark, line, clouds):
    line(WHAT, "usual")
    prediction, truth = clouds

    def usual():
        distance = torch.cdist(prediction, truth)
        (distance.min(2).values.square().mean() + distance.min(1).values.square().mean()).backward()

    benchmark(usual)


def test_two_queries(benchmark, line, clouds):
    """Each cloud asked for its nearest points by the other; building the two trees is part of it."""
    line(WHAT, "limit")
    prediction, truth = (cloud.detach()[0].double().numpy() for cloud in clouds)

    def limit():
        cKDTree(truth).query(prediction)
        cKDTree(prediction).query(truth)

    benchmark(limit)
