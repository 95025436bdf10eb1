"""3PU's network as a whole."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import Trait
from pcsr_plugins.objectives.progressive import ProgressiveChamfer
from tests.plugins.compare import close
from tests.plugins.published import mpu


@pytest.mark.parametrize(("rate", "levels"), [(2, 1), (4, 2), (16, 4)])
def test_a_doubling_level_has_a_code_of_one_number(rate, levels):
    """Of two numbers, the published level's code needs 128 weights more."""
    assert mpu(rate).parameter_count == levels * (76_155 - 128) == levels * 76_027


@torch.no_grad()
def test_mpu_follows_a_permutation():
    network, points, shuffled = mpu(4, neighbours=5).double(), torch.rand(2, 20, 3).double(), torch.randperm(20)
    assert all(
        Trait.PERMUTATION_EQUIVARIANT in part.traits for part in (network.encoder, network.backbone, network.upsampler)
    )
    dense, other = network(points, 4), network(points[:, shuffled], 4)
    close(other.view(2, 20, 4, 3), dense.view(2, 20, 4, 3)[:, shuffled], 1e-9)


def test_a_few_steps_lower_the_loss_and_reach_every_weight():
    network, objective = mpu(4, neighbours=8), ProgressiveChamfer()
    truth = F.normalize(torch.randn(2, 128, 3), dim=-1)
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    totals = []
    for _ in range(8):
        optimizer.zero_grad()
        loss = sum(objective.losses(network, truth[:, ::4], truth, 4).values())
        loss.backward()
        if not totals:
            assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in network.parameters())
        optimizer.step()
        totals.append(loss.item())
    assert totals[-1] < 0.8 * totals[0]
