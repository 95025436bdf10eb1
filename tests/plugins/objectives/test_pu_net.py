"""`pu-net`: fidelity and repulsion."""

import pytest
import torch

from pcsr.metrics.chamfer import chamfer
from pcsr_plugins.layers.point_losses import matched_distance, repulsion
from pcsr_plugins.objectives.pu_net import PUNetLoss
from tests.plugins.compare import close


@pytest.mark.parametrize("fidelity", ["emd", "chamfer"])
def test_the_objective_is_fidelity_and_repulsion(fidelity):
    prediction, target = torch.rand(3, 12, 3), torch.rand(3, 12, 3)
    losses = PUNetLoss(fidelity=fidelity)(prediction, target)
    assert list(losses) == [fidelity, "repulsion"]
    emd = matched_distance(prediction, target, squared=True).mean() / 3  # mean over the coordinates, too
    close(losses[fidelity], 100 * (emd if fidelity == "emd" else chamfer(prediction, target).mean()))
    close(losses["repulsion"], repulsion(prediction).mean())
    halved = PUNetLoss(fidelity=fidelity, weight=50.0, repulsion=0.5)(prediction, target)
    close(sum(halved.values()), sum(losses.values()) / 2)
