from itertools import permutations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import RunError, UserError
from pcsr.metrics import emd
from pcsr.metrics.emd import EXACT


def clouds(n, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [torch.randn(2, n, 3, generator=generator, dtype=torch.float64) for _ in range(2)]


def naive(a, b):
    """Every assignment tried."""
    orders = list(permutations(range(a.shape[1])))
    return torch.stack([(a - b[:, list(order)]).norm(dim=-1).mean(1) for order in orders]).min(0).values


@given(st.integers(1, 5), st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_emd_agrees_with_trying_every_assignment_and_is_symmetric(n, seed):
    a, b = clouds(n, seed)
    assert torch.allclose(emd(a, b), naive(a, b))
    assert torch.allclose(emd(a, b), emd(b, a))


@given(st.floats(0.01, 100), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_emd_grows_with_the_scale_and_ignores_the_order(scale, seed):
    a, b = clouds(20, seed)
    assert torch.allclose(emd(scale * a, scale * b), scale * emd(a, b))
    assert torch.allclose(emd(a.flip(1), b), emd(a, b))


def test_a_cloud_is_at_no_distance_from_itself():
    a, _ = clouds(30)
    assert emd(a, a.flip(1)).tolist() == [0, 0]


def test_every_point_is_used_once():
    # Both points of a have the same nearest point; only one may keep it.
    a, b = torch.tensor([[[0.0, 0, 0], [0, 0, 0]]]), torch.tensor([[[0.0, 0, 0], [0, 0, 6]]])
    assert emd(a, b).item() == 3


def test_a_large_cloud_moved_by_little_costs_that_little():
    a = torch.rand(1, EXACT + 1, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    step = torch.tensor([1e-5, 0, 0], dtype=torch.float64)
    # By less than half the spacing: everything stays with its own copy.
    assert emd(a, a.flip(1) + step).item() == pytest.approx(1e-5, rel=0.011)


def test_clouds_of_two_sizes_are_refused():
    with pytest.raises(UserError, match="got 5 and 6 points"):
        emd(torch.zeros(1, 5, 3), torch.zeros(1, 6, 3))


def test_points_that_are_not_finite_are_said():
    a, b = clouds(5)
    a[1, 2, 0] = float("nan")
    with pytest.raises(RunError, match="1 points that are not finite"):
        emd(a, b)
