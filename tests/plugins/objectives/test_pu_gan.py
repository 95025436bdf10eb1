"""`pu-gan`: the discriminator, uniformity and the weighted sum of the losses."""

import math

import pytest
import torch
from torch.nn import functional as F

from pcsr.geometry.farthest import farthest_points
from pcsr_plugins.layers.point_losses import hinge_repulsion, matched_distance
from pcsr_plugins.objectives.pu_gan import SHARES, Discriminator, PuGan, uniformity
from tests.plugins.published import awake


def sphere(n: int, dtype=torch.float32) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3, dtype=dtype), dim=-1)


def test_the_discriminator_sees_a_set():
    judge, points = awake(Discriminator()), torch.randn(3, 15, 3)
    verdict = judge(points)
    assert verdict.shape == (3,)
    torch.testing.assert_close(judge(points[:, torch.randperm(15)]), verdict)
    single = judge.single(points[0])
    joint = judge.attention(torch.cat([single, single.amax(0).expand(15, -1)], dim=1)[None])[0]
    whole = torch.stack([judge.widen(judge.joint(point)) for point in joint]).amax(0)
    torch.testing.assert_close(verdict[0], judge.verdict(whole)[0])


def slow_uniformity(cloud: torch.Tensor) -> float:
    """One cloud (n 3), one disc and one point at a time."""
    n, values = len(cloud), []
    for share in SHARES:
        gaps = []
        for seed in farthest_points(cloud.numpy(), max(1, int(0.05 * n))):
            away = (cloud - cloud[seed]).norm(dim=-1)
            order = away.argsort().tolist()[: max(2, int(share * n))]
            disc = [j if away[j] <= math.sqrt(share) else seed for j in order]
            for a, j in enumerate(disc):
                gap = min(float((cloud[j] - cloud[other]).norm()) for b, other in enumerate(disc) if b != a)
                even = math.sqrt(math.pi / n)
                gaps.append((math.sqrt(gap**2 + 1e-8) - even) ** 2 / even)
        values.append((100 * share) ** 2 * sum(gaps) / len(gaps))
    return sum(values) / len(values)


@pytest.mark.parametrize("n", [20, 300, 700])
def test_uniformity_is_that_of_each_disc_and_each_point(n):
    clouds = torch.stack([sphere(n, torch.float64), sphere(n, torch.float64) * torch.tensor([1, 1, 0.1])])
    expected = torch.tensor([slow_uniformity(cloud) for cloud in clouds], dtype=torch.float64)
    torch.testing.assert_close(uniformity(clouds), expected)


def test_uniformity_likes_an_even_disc_better():
    n = torch.arange(1, 801, dtype=torch.float64)
    angle = n * math.pi * (3 - math.sqrt(5))  # a sunflower: points that share the unit disc evenly
    even = torch.stack([torch.cos(angle), torch.sin(angle), 0 * n], dim=1) * (n / 800).sqrt()[:, None]
    random = torch.rand(800, 2, dtype=torch.float64)
    angle = 2 * math.pi * random[:, 1]
    uneven = torch.stack([torch.cos(angle), torch.sin(angle), 0 * angle], dim=1) * random[:, :1].sqrt()
    values = uniformity(torch.stack([even, uneven]))
    assert values[0] < 0.5 * values[1]


def test_uniformity_of_coinciding_points_has_a_gradient_without_a_hole():
    points = sphere(200).repeat(2, 1).unsqueeze(0).requires_grad_()
    uniformity(points).sum().backward()
    assert points.grad.isfinite().all()


def test_the_objective_is_its_weighted_terms():
    objective = PuGan()
    made, true = 0.1 * torch.stack([sphere(60), sphere(60)]), torch.stack([sphere(60), sphere(60)])
    losses = objective(made, true)
    assert list(losses) == ["emd", "uniform", "repulsion", "generator", "discriminator"]
    assert losses["repulsion"] > 0
    apart = matched_distance(made, true)
    d_made, d_true = objective.discriminator(made), objective.discriminator(true)
    expected = (
        100 * apart.mean(),
        10 * uniformity(made).mean(),
        hinge_repulsion(made).mean(),
        0.5 * ((d_made - 1) ** 2).mean(),
        ((d_true - 1) ** 2).mean() + (d_made**2).mean(),
    )
    for got, wanted in zip(losses.values(), expected, strict=True):
        torch.testing.assert_close(got, wanted)


def test_generator_and_discriminator_do_not_train_each_other():
    objective, true = awake(PuGan()), sphere(50).unsqueeze(0)
    made = (0.1 * sphere(50)).unsqueeze(0).requires_grad_()
    losses = objective(made, true)
    judge = list(objective.discriminator.parameters())
    for name in ("emd", "uniform", "repulsion", "generator"):
        grads = torch.autograd.grad(losses[name], [made, *judge], retain_graph=True, allow_unused=True)
        assert all(grad is None for grad in grads[1:]), name
        assert grads[0].abs().max() > 0, name
    grads = torch.autograd.grad(losses["discriminator"], [made, *judge], allow_unused=True)
    assert grads[0] is None
    assert all(grad.abs().max() > 0 for grad in grads[1:])
