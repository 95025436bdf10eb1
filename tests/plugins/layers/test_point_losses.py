"""Matching and repulsion against all assignments, and all pairs of points."""

import itertools

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pcsr import RunError, UserError
from pcsr_plugins.layers.point_losses import hinge_repulsion, matched_distance, repulsion


def cloud(seed: int, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def close(a, b, atol=1e-9):
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


@pytest.mark.parametrize("squared", [False, True])
@given(seed=st.integers(0, 10_000), n=st.integers(1, 5))
def test_matching_is_the_best_of_all_assignments(squared, seed, n):
    prediction, target = cloud(seed, 2, n), cloud(seed + 1, 2, n)
    for b in range(2):
        costs = []
        for order in itertools.permutations(range(n)):
            lengths = [(prediction[b, i] - target[b, j]).norm() for i, j in enumerate(order)]
            costs.append(sum(length**2 if squared else length for length in lengths) / n)
        close(matched_distance(prediction, target, squared=squared)[b], min(costs))


@pytest.mark.parametrize("squared", [False, True])
@pytest.mark.parametrize("spread", [1.0, 1e-2, 1e-4, 1e-8, 0.0])
def test_matching_is_scipys_on_the_plain_costs_however_the_points_crowd(squared, spread):
    target = cloud(1, 2, 150)
    prediction = 0.3 + spread * cloud(2, 2, 150)
    for b in range(2):
        cost = cdist(prediction[b], target[b], "sqeuclidean" if squared else "euclidean")
        best = cost[linear_sum_assignment(cost)].mean()
        close(matched_distance(prediction, target, squared=squared)[b].item(), best, 1e-10)


def test_matching_of_clouds_that_are_one_point_each_is_their_distance():
    close(matched_distance(torch.zeros(1, 7, 3), torch.ones(1, 7, 3)), torch.tensor([3.0]).sqrt(), 1e-6)


@given(seed=st.integers(0, 10_000), n=st.integers(2, 40))
def test_the_best_way_to_a_moved_copy_is_the_move(seed, n):
    prediction, offset = cloud(seed, 1, n), cloud(seed + 1, 1, 1) / 3
    target = (prediction + offset)[:, torch.randperm(n, generator=torch.Generator().manual_seed(seed))]
    close(matched_distance(prediction, target), offset.norm().view(1))
    close(matched_distance(prediction, target, squared=True), offset.square().sum().view(1))


@pytest.mark.parametrize("squared", [False, True])
def test_the_gradient_of_matching_points_away_from_the_own_target_alone(squared):
    prediction = torch.tensor([[[0.0, 0, 0], [1, 0, 0]]], requires_grad=True)
    target = torch.tensor([[[1.0, 0, 0.5], [0, 0.5, 0]]], requires_grad=True)
    matched_distance(prediction, target, squared=squared).sum().backward()
    wanted = torch.tensor([[[0.0, -0.5, 0], [0, 0, -0.5]]])
    close(prediction.grad, wanted)
    close(target.grad, -wanted.flip(1))


def test_a_point_on_its_target_has_nowhere_to_go():
    prediction = torch.zeros(1, 2, 3, requires_grad=True)
    matched_distance(prediction, torch.zeros(1, 2, 3)).sum().backward()
    close(prediction.grad, torch.zeros(1, 2, 3))


def test_matching_refuses_clouds_of_two_sizes_and_what_is_not_finite():
    with pytest.raises(UserError, match="clouds of one size, got 4 predicted and 5 true points"):
        matched_distance(cloud(0, 1, 4), cloud(1, 1, 5))
    with pytest.raises(RunError, match="not finite"):
        matched_distance(cloud(0, 1, 4) / 0, cloud(1, 1, 4))


def distances_to_nearest(points: torch.Tensor, i: int, k: int) -> list[torch.Tensor]:
    return sorted((points[i] - points[j]).norm() for j in range(len(points)) if j != i)[:k]


@given(seed=st.integers(0, 10_000), n=st.integers(5, 12), scale=st.sampled_from([0.02, 0.05, 1.0]))
def test_repulsions_are_their_formulas_point_by_point(seed, n, scale):
    points = scale * cloud(seed, 2, n)
    for b in range(2):
        near = [d for i in range(n) for d in distances_to_nearest(points[b], i, 4)]
        pu_net = [0.07 - d * torch.exp(-(d**2) / 0.03**2) for d in near]
        pu_gan = [max(0, 0.001 - d**2) for d in near]
        close(repulsion(points)[b], sum(pu_net) / len(near))
        close(hinge_repulsion(points)[b], torch.as_tensor(sum(pu_gan), dtype=torch.float64) / len(near))


@pytest.mark.parametrize("term", [repulsion, hinge_repulsion])
def test_a_step_against_a_repulsion_parts_points_that_crowd(term):
    points = (0.005 * cloud(3, 1, 6)).requires_grad_()
    (gradient,) = torch.autograd.grad(term(points).sum(), points)
    with torch.no_grad():
        moved = points - 1e-4 * gradient
        assert torch.pdist(moved[0]).mean() > torch.pdist(points[0]).mean()


@pytest.mark.parametrize("term", [repulsion, hinge_repulsion])
def test_points_that_coincide_give_finite_gradients(term):
    points = torch.zeros(1, 6, 3, requires_grad=True)
    term(points).sum().backward()
    assert points.grad.isfinite().all()
