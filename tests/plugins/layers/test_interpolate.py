"""Features carried from points to positions, against one position at a time."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr_plugins.layers.interpolate import interpolate, inverse_distance


def clouds(seed: int, *, points: int = 12, positions: int = 9) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    random = torch.Generator().manual_seed(seed)
    return tuple(torch.randn(2, n, c, generator=random).double() for n, c in ((positions, 3), (points, 3), (points, 5)))


def slowly(positions: torch.Tensor, points: torch.Tensor, features: torch.Tensor, k: int, power: float) -> torch.Tensor:
    rows = []
    for b in range(len(positions)):
        for position in positions[b]:
            distance = (points[b] - position).norm(dim=-1)
            nearest = distance.argsort()[:k]
            weight = distance[nearest] ** -power
            rows.append((weight[:, None] * features[b, nearest]).sum(0) / weight.sum())
    return torch.stack(rows).view(len(positions), -1, features.shape[-1])


@given(st.integers(0, 99), st.integers(1, 6), st.sampled_from([1, 2]))
def test_a_place_has_the_mean_of_its_nearest_points_by_inverse_distance(seed, k, power):
    positions, points, features = clouds(seed)
    expected = slowly(positions, points, features, k, power)
    torch.testing.assert_close(interpolate(positions, points, features, k, power), expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("power", [1, 2])
def test_where_a_point_is_its_features_are(power):
    _, points, features = clouds(0)
    carried = interpolate(points.float(), points.float(), features.float(), power=power)
    torch.testing.assert_close(carried, features.float(), atol=1e-5, rtol=0)


def test_the_nearest_come_first_and_the_weights_sum_to_one():
    positions, points, _ = clouds(1)
    near, weights = inverse_distance(positions, points, 4)
    torch.testing.assert_close(near[..., 0], torch.cdist(positions, points).argmin(-1))
    torch.testing.assert_close(weights.sum(-1), torch.ones(2, 9).double())
    assert (weights.diff(dim=-1) <= 0).all()


@pytest.mark.parametrize("power", [1, 2])
def test_the_gradient_by_features_and_by_places_is_right(power):
    positions, points, features = clouds(2, points=6, positions=4)
    assert torch.autograd.gradcheck(
        lambda where, what: interpolate(where, points, what, power=power),
        (positions.requires_grad_(), features.requires_grad_()),
    )


def test_a_place_on_a_point_has_a_finite_gradient():
    positions = torch.zeros(1, 1, 3, requires_grad=True)
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [0, 2, 0]]])
    interpolate(positions, points, torch.ones(1, 3, 2)).sum().backward()
    assert positions.grad is not None
    assert positions.grad.isfinite().all()


def test_fewer_points_than_asked_are_refused():
    with pytest.raises(UserError, match="3 neighbours were asked of 2 points"):
        interpolate(torch.randn(1, 4, 3), torch.randn(1, 2, 3), torch.randn(1, 2, 5))
