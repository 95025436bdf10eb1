"""Dis-PU's network as a whole."""

import pytest
import torch
from torch.nn import functional as F

from pcsr.metrics.chamfer import chamfer
from pcsr_plugins.objectives.dis_pu import DisPU as Objective
from tests.plugins.published import dis_pu


def sphere(n: int) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3), dim=-1)


def clouds(n: int) -> torch.Tensor:
    return torch.stack([sphere(n), 0.5 * sphere(n)])


def test_the_network_is_as_large_as_published():
    assert dis_pu().parameter_count == 1_046_966  # 1,047 K


def test_the_order_of_the_points_changes_the_order_of_the_result_alone():
    net, points, shuffled = dis_pu(5).double(), torch.randn(1, 12, 3).double(), torch.randperm(12)
    one, other = net(points, 4), net(points[:, shuffled], 4)
    torch.testing.assert_close(other.view(12, 4, 3), one.view(12, 4, 3)[shuffled])


def test_objects_of_a_batch_are_independent_in_training_too():
    net, points = dis_pu(5).double().train(), clouds(12).double()
    torch.testing.assert_close(net(points, 4), torch.cat([net(points[:1], 4), net(points[1:], 4)]))


def test_gradient_reaches_every_weight():
    net, objective = dis_pu(8), Objective()
    sum(objective.losses(net, clouds(24), clouds(96), 4).values()).backward()
    for name, weight in net.named_parameters():
        if not name.endswith("key.bias"):  # softmax does not depend on it: its gradient is rounding alone
            assert weight.grad is not None, name
            assert weight.grad.abs().max() > 0, name


@pytest.mark.slow
def test_a_few_steps_bring_both_clouds_nearer():
    net, objective, points, true = dis_pu(8), Objective(ramp=5), clouds(32), clouds(128)
    adam, history = torch.optim.Adam(net.parameters(), lr=1e-3), []
    for _ in range(25):
        losses = objective.losses(net, points, true, 4)
        adam.zero_grad()
        sum(losses.values()).backward()
        adam.step()
        with torch.no_grad():
            history.append([float(chamfer(cloud, true).mean()) for cloud in net.stages(points, 4)])
    for first, last in zip(history[0], history[-1], strict=True):
        assert last < 0.7 * first
