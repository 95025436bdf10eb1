"""PU-GAN's network as a whole."""

import pytest
import torch
from torch.nn import functional as F

from pcsr.geometry.farthest import farthest_points
from pcsr_plugins.objectives.pu_gan import Discriminator, PuGan
from tests.plugins.published import awake, pu_gan


def count(module) -> int:
    return sum(weight.numel() for weight in module.parameters())


def sphere(n: int, dtype=torch.float32) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3, dtype=dtype), dim=-1)


def test_generator_and_discriminator_are_as_large_as_published():
    assert count(pu_gan()) == 541_601  # 541.6 K
    assert count(Discriminator()) == 142_594  # 142.6 K


def test_the_farthest_of_six_copies_make_a_rate_of_four():
    net, points = pu_gan(channels=16), torch.randn(2, 20, 3)
    assert net.train()(points, 4).shape == (2, 80, 3)
    dense = net.eval()(points, 4)
    assert dense.shape == (2, 80, 3)
    made = net.upsampler(points, net.backbone(points, net.encoder(points)), 4)
    assert made.shape == (2, 120, 3)
    for row, kept in zip(made, dense, strict=True):
        assert torch.equal(row[torch.from_numpy(farthest_points(row.detach().numpy(), 80))], kept)


def test_the_order_of_the_points_changes_the_order_of_the_result_alone():
    net = awake(pu_gan(neighbours=5, channels=16)).double()
    points, shuffled = torch.randn(1, 12, 3).double(), torch.randperm(12)
    one, other = (net.upsampler(p, net.backbone(p, net.encoder(p)), 4) for p in (points, points[:, shuffled]))
    torch.testing.assert_close(other.view(12, 6, 3), one.view(12, 6, 3)[shuffled])


def test_gradient_reaches_every_weight():
    net, objective = awake(pu_gan(neighbours=8)), awake(PuGan())
    points, true = torch.stack([sphere(24), sphere(24)]), torch.stack([sphere(96), sphere(96)])
    sum(objective(net(points, 4), true).values()).backward()
    for name, weight in [*net.named_parameters(), *objective.named_parameters()]:
        assert weight.grad is not None, name
        assert weight.grad.abs().max() > 0, name


@pytest.mark.slow
def test_a_few_steps_bring_the_clouds_nearer_and_teach_the_discriminator():
    net, objective = pu_gan(neighbours=8), PuGan()
    groups = [{"params": net.parameters()}, {"params": objective.parameters(), "lr": 1e-3 * objective.lr_multiplier}]
    adam = torch.optim.Adam(groups, lr=1e-3)
    points = torch.stack([sphere(32), 0.5 * sphere(32)])
    true = torch.stack([sphere(128), 0.5 * sphere(128)])
    history = []
    for _ in range(25):
        losses = objective(net(points, 4), true)
        adam.zero_grad()
        sum(losses.values()).backward()
        adam.step()
        history.append({name: float(loss.detach()) for name, loss in losses.items()})
    assert history[-1]["emd"] < 0.7 * history[0]["emd"]
    assert history[-1]["discriminator"] < history[0]["discriminator"]
