"""PU-Net's network as a whole."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import Trait
from pcsr_plugins.objectives.pu_net import PUNetLoss
from tests.plugins.compare import close
from tests.plugins.published import pu_net


def test_pu_net_is_as_large_as_published():
    """PU-GCN publishes 812.0 K, of its own writing of PU-Net, whose branches hang on each other (see `Branches`)."""
    # PU-Net's own code: three of the four branches take 259 channels rather than 256.
    assert pu_net().parameter_count == 812_003 + 3 * (259 - 256) * 256 == 814_307


@pytest.mark.parametrize("n", [1, 2, 5, 17, 30])
@torch.no_grad()
def test_pu_net_takes_any_number_of_points(n):
    dense = pu_net()(torch.randn(2, n, 3), 4)
    assert dense.shape == (2, 4 * n, 3)
    assert dense.isfinite().all()


@torch.no_grad()
def test_pu_net_follows_a_permutation():
    network, points, shuffled = pu_net(), torch.rand(2, 60, 3), torch.randperm(60)
    assert all(Trait.PERMUTATION_EQUIVARIANT in part.traits for part in (network.encoder, network.backbone))
    dense, other = network(points, 4), network(points[:, shuffled], 4)
    close(other.view(2, 4, 60, 3), dense.view(2, 4, 60, 3)[:, :, shuffled])


def test_a_few_steps_lower_the_loss_and_reach_every_weight():
    network, objective = pu_net(), PUNetLoss()
    truth = F.normalize(torch.randn(2, 128, 3), dim=-1)
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    totals = []
    for _ in range(12):
        optimizer.zero_grad()
        loss = sum(objective(network(truth[:, ::4], 4), truth).values())
        loss.backward()
        if not totals:
            assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in network.parameters())
        optimizer.step()
        totals.append(loss.item())
    assert totals[-1] < 0.7 * totals[0]
