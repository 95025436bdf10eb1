"""`pu-net`: fidelity and repulsion."""

import torch

from pcsr_plugins.layers.point_losses import matched_distance, repulsion
from pcsr_plugins.objectives.pu_net import PUNetLoss
from tests.plugins.compare import close


def test_the_objective_is_fidelity_and_repulsion():
    prediction, target = torch.rand(3, 12, 3), torch.rand(3, 12, 3)
    losses = PUNetLoss()(prediction, target)
    assert list(losses) == ["emd", "repulsion"]
    emd = matched_distance(prediction, target, squared=True).mean() / 3  # mean over the coordinates, too
    close(losses["emd"], 100 * emd)
    close(losses["repulsion"], repulsion(prediction).mean())
    halved = PUNetLoss(weight=50.0, repulsion=0.5)(prediction, target)
    close(sum(halved.values()), sum(losses.values()) / 2)
