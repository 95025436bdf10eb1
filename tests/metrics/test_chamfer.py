import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import RunError
from pcsr.metrics import chamfer


def clouds(*sizes, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [torch.randn(2, n, 3, generator=generator, dtype=torch.float64) for n in sizes]


def naive(a, b):
    squared = (a[:, :, None] - b[:, None]).square().sum(-1)
    return squared.min(2).values.mean(1) + squared.min(1).values.mean(1)


@given(st.integers(1, 30), st.integers(1, 30), st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_chamfer_agrees_with_its_definition_and_is_symmetric(p, t, seed):
    a, b = clouds(p, t, seed=seed)
    assert torch.allclose(chamfer(a, b), naive(a, b))
    assert torch.allclose(chamfer(a, b), chamfer(b, a))


@given(st.floats(0.01, 100), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_chamfer_grows_with_the_square_of_the_scale_and_ignores_the_order(scale, seed):
    a, b = clouds(20, 30, seed=seed)
    assert torch.allclose(chamfer(scale * a, scale * b), scale**2 * chamfer(a, b))
    assert torch.allclose(chamfer(a.flip(1), b), chamfer(a, b))


def test_a_known_value():
    a, b = torch.tensor([[[0.0, 0, 0], [0, 0, 4]]]), torch.tensor([[[0.0, 0, 1]]])
    assert chamfer(a, b).item() == (1 + 9) / 2 + 1


def test_a_cloud_is_at_no_distance_from_itself():
    (a,) = clouds(30)
    assert torch.equal(chamfer(a, a.flip(1)), torch.zeros(2, dtype=torch.float64))


def test_gradients_agree_with_those_of_the_definition():
    ours, plain = [[x.requires_grad_() for x in clouds(25, 40)] for _ in range(2)]
    weight = torch.tensor([1.0, -2.0])
    (chamfer(*ours) * weight).sum().backward()
    (naive(*plain) * weight).sum().backward()
    for a, b in zip(ours, plain, strict=True):
        assert torch.allclose(a.grad, b.grad)


def test_gradients_reach_both_clouds_in_float32():
    a, b = (x.float().requires_grad_() for x in clouds(10, 10))
    value = chamfer(a, b)
    value.sum().backward()
    assert value.dtype == torch.float32
    assert a.grad.abs().min() > 0
    assert b.grad.abs().sum() > 0


@pytest.mark.parametrize("spoilt", [0, 1])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_points_that_are_not_finite_are_said(spoilt, value):
    pair = clouds(5, 6)
    pair[spoilt][0, 3, 1] = value
    with pytest.raises(RunError, match=f"the {['first', 'second'][spoilt]} .* has 1 points that are not finite"):
        chamfer(*pair)


def test_an_empty_cloud_is_said():
    with pytest.raises(RunError, match="the first of two compared clouds has no points"):
        chamfer(*clouds(0, 5))
