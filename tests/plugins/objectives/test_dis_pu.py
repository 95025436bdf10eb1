"""`dis-pu`: the losses of the coarse and of the refined cloud."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import Widths
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.encoders.linear import Linear
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.point_losses import hinge_repulsion
from pcsr_plugins.objectives.dis_pu import DisPU as Objective
from pcsr_plugins.upsamplers.shuffle import Shuffle
from tests.plugins.published import dis_pu


def sphere(n: int) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3), dim=-1)


def clouds(n: int) -> torch.Tensor:
    return torch.stack([sphere(n), 0.5 * sphere(n)])


def test_the_objective_judges_both_clouds():
    net, objective, points, true = dis_pu(8), Objective(), clouds(16), clouds(64)
    losses = objective.losses(net, points, true, 4)
    coarse, fine = net.stages(points, 4)
    expected = {
        "fine": 0.01 * 1000 * chamfer(fine, true).mean(),
        "repulsion": hinge_repulsion(fine).mean(),
        "coarse": 1000 * chamfer(coarse, true).mean(),
    }
    assert losses.keys() == expected.keys()
    for name, loss in losses.items():
        torch.testing.assert_close(loss, expected[name])


def test_the_refined_cloud_counts_more_and_more():
    net, objective, points, true = dis_pu(8), Objective(ramp=2), clouds(16), clouds(64)
    weights, counted = [], []
    for _ in range(10):
        weights.append(objective.weight)
        losses = objective.losses(net, points, true, 4)
        counted.append(float(losses["fine"].detach()))
    assert weights == [0.01, 0.01, 0.1, 0.1, 0.5, 0.5, 1, 1, 1, 1]
    assert counted == pytest.approx([counted[-1] * weight for weight in weights])


def test_only_training_counts_and_the_count_is_kept():
    net, objective, points, true = dis_pu(8), Objective(ramp=2), clouds(16), clouds(64)
    for _ in range(3):
        objective.losses(net, points, true, 4)
    with torch.no_grad():
        objective.losses(net, points, true, 4)
    objective.eval().losses(net, points, true, 4)
    taken_up = Objective(ramp=2)
    taken_up.load_state_dict(objective.state_dict())
    assert taken_up.weight == objective.weight == 0.1
    assert int(taken_up.counted) == 3


def test_an_upsampler_without_stages_is_judged_by_its_result():
    widths = Widths(visual=16, refined=16, rate=4)
    backbone = DenseEdgeConvs(Widths(visual=16), blocks=1, neighbours=4)
    net = Network(
        Linear(widths, channels=16),
        None,
        NoFusion(widths),
        backbone,
        Shuffle(Widths(refined=backbone.channels, rate=4)),
    )
    assert Objective().losses(net, clouds(16), clouds(64), 4).keys() == {"fine", "repulsion"}
