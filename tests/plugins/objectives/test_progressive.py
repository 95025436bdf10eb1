"""`progressive`: the Chamfer distance of each level."""

import torch

from pcsr import Upsampler, Widths
from pcsr.geometry.farthest import farthest_points
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.encoders.linear import Linear
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.objectives.progressive import ProgressiveChamfer
from tests.plugins.compare import close


class Given(Upsampler):
    """Its clouds are its weights."""

    def __init__(self, clouds):
        super().__init__()
        self.clouds = torch.nn.ParameterList(clouds)

    def stages(self, points, features, rate):
        return list(self.clouds)


def levels(*clouds) -> Network:
    backbone = DenseEdgeConvs(Widths(visual=24), blocks=1, neighbours=1)
    return Network(Linear(Widths()), None, NoFusion(Widths()), backbone, Given(clouds))


def test_every_level_is_judged_by_the_farthest_points_of_the_truth():
    clouds, truth = [torch.rand(2, n, 3) for n in (4, 8, 16)], torch.rand(2, 16, 3)
    losses = ProgressiveChamfer().losses(levels(*clouds), truth[:, :2], truth, 8)
    assert list(losses) == ["chamfer-4", "chamfer-8", "chamfer-16"]
    for cloud, loss in zip(clouds, losses.values(), strict=True):
        n, total = cloud.shape[1], 0
        for b in range(2):
            thinned = truth[b, farthest_points(truth[b].numpy(), n)] if n < 16 else truth[b]
            total = total + chamfer(cloud[b : b + 1], thinned[None])[0]
        close(loss, total / 2, 1e-6)


def test_a_level_of_more_points_than_the_truth_is_judged_by_all_of_it():
    clouds, truth = [torch.rand(1, 8, 3), torch.rand(1, 16, 3)], torch.rand(1, 6, 3)
    losses = ProgressiveChamfer().losses(levels(*clouds), truth[:, :2], truth, 8)
    close(losses["chamfer-8"], chamfer(clouds[0], truth)[0], 1e-6)


def test_the_result_alone_is_judged_by_the_chamfer_distance():
    a, b = torch.rand(2, 5, 3), torch.rand(2, 7, 3)
    close(ProgressiveChamfer()(a, b)["chamfer"], chamfer(a, b).mean(), 0)
