"""`chamfer`: the mean Chamfer distance."""

import torch

from pcsr.metrics.chamfer import chamfer
from pcsr_plugins.objectives.chamfer import Chamfer
from tests.plugins.compare import close


def test_objective_is_the_mean_chamfer_distance():
    a, b = torch.randn(3, 9, 3), torch.randn(3, 14, 3)
    losses = Chamfer()(a, b)
    assert list(losses) == ["chamfer"]
    close(losses["chamfer"], sum(chamfer(a[i : i + 1], b[i : i + 1])[0] for i in range(3)) / 3)
