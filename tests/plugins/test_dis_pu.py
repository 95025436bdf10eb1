"""Dis-PU's upsampler and objective against slow and obvious forms of themselves."""

import math

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError, Widths
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.encoders.linear import Linear
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.point_losses import hinge_repulsion
from pcsr_plugins.objectives.dis_pu import DisPU as Objective
from pcsr_plugins.upsamplers.dis_pu import DisPU, Refiner
from pcsr_plugins.upsamplers.shuffle import Shuffle


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield


def network(neighbours: int = 16) -> Network:
    widths = Widths(visual=24, rate=4)
    backbone = DenseEdgeConvs(widths, neighbours=neighbours)
    upsampler = DisPU(Widths(visual=24, refined=backbone.channels, rate=4))
    return Network(Linear(widths), None, NoFusion(widths), backbone, upsampler)


def sphere(n: int) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3), dim=-1)


def clouds(n: int) -> torch.Tensor:
    return torch.stack([sphere(n), 0.5 * sphere(n)])


# --- the network


def test_the_network_is_as_large_as_published():
    assert network().parameter_count == 1_046_966  # 1,047 K


def literal(refiner: Refiner, points: torch.Tensor, features: torch.Tensor) -> torch.Tensor:
    """One cloud (n 3), (n c), one point and one neighbour at a time."""
    near = [(points - point).norm(dim=-1).argsort().tolist()[: refiner.neighbours] for point in points]
    kernels = torch.stack(
        [torch.stack([refiner.kernel(points[j] - points[i]) for j in near[i]]) for i in range(len(points))]
    )
    mean, spread = kernels.mean((0, 1)), kernels.var((0, 1), unbiased=False)
    kernels = F.relu((kernels - mean) / (spread + 1e-5).sqrt() * refiner.norm.weight + refiner.norm.bias)
    rows = []
    for i, point in enumerate(points):
        edges = [torch.cat([points[j] - point, points[j], features[j]]) for j in near[i]]
        said = [F.relu(refiner.edge_again(F.relu(refiner.edge(edge)))) for edge in edges]
        summed = sum(torch.outer(h, kernel) for h, kernel in zip(said, kernels[i], strict=True))
        local = F.relu(refiner.local(summed.flatten()))
        skip = F.relu(refiner.skip(torch.stack(edges).amax(0)))
        query = refiner.query(features[i])
        logits = torch.stack([query @ refiner.key(other) for other in features]) / math.sqrt(len(query))
        heard = F.relu(refiner.back(logits.softmax(0) @ refiner.value(features)))
        rows.append(F.relu(refiner.merge(local + skip + heard)))
    return torch.stack(rows)


def test_the_refiner_is_its_three_units_forward_and_backward():
    refiner = Refiner(8, 5).double()
    with torch.no_grad():
        refiner.norm.weight.uniform_(0.5, 2)
        refiner.norm.bias.normal_()
    points = torch.randn(2, 13, 3, dtype=torch.float64, requires_grad=True)
    features = torch.randn(2, 13, 8, dtype=torch.float64, requires_grad=True)
    fast = refiner(points, features)
    assert fast.shape == (2, 13, refiner.channels) == (2, 13, 16)
    slow = torch.stack([literal(refiner, p, f) for p, f in zip(points, features, strict=True)])
    torch.testing.assert_close(fast, slow)
    towards, wanted = torch.randn_like(fast), (points, features, *refiner.parameters())
    for a, b in zip(*(torch.autograd.grad(y, wanted, towards) for y in (fast, slow)), strict=True):
        torch.testing.assert_close(a, b)


def test_the_coarse_cloud_comes_of_tiled_features_and_the_grid():
    upsampler = DisPU(Widths(refined=10, rate=4), channels=8, neighbours=5).double()
    points, features = torch.randn(1, 6, 3).double(), torch.randn(1, 6, 10).double()
    coarse, fine = upsampler.stages(points, features, 4)
    assert coarse.shape == fine.shape == (1, 24, 3)
    for i in range(6):
        for r, place in enumerate(upsampler.grid):
            copy = torch.cat([features[0, i], place.double()])
            expected = upsampler.coarse(F.relu(upsampler.expand(F.relu(upsampler.copy(copy)))))
            torch.testing.assert_close(coarse[0, 4 * i + r], expected)
    assert torch.equal(upsampler(points, features, 4), fine)


def test_a_point_is_moved_by_half_at_most():
    upsampler = DisPU(Widths(refined=10, rate=4), channels=8, neighbours=5)
    with torch.no_grad():
        upsampler.way[-1].weight.mul_(1e4)
    coarse, fine = upsampler.stages(torch.randn(1, 6, 3), torch.randn(1, 6, 10), 4)
    assert 0.49 < (fine - coarse).abs().max() <= 0.5 + 1e-6
    with torch.no_grad():
        upsampler.way[-1].weight.zero_()
        upsampler.way[-1].bias.zero_()
    coarse, fine = upsampler.stages(torch.randn(1, 6, 3), torch.randn(1, 6, 10), 4)
    torch.testing.assert_close(fine, coarse)


def test_the_order_of_the_points_changes_the_order_of_the_result_alone():
    net, points, shuffled = network(5).double(), torch.randn(1, 12, 3).double(), torch.randperm(12)
    one, other = net(points, 4), net(points[:, shuffled], 4)
    torch.testing.assert_close(other.view(12, 4, 3), one.view(12, 4, 3)[shuffled])


def test_objects_of_a_batch_are_independent_in_training_too():
    net, points = network(5).double().train(), clouds(12).double()
    torch.testing.assert_close(net(points, 4), torch.cat([net(points[:1], 4), net(points[1:], 4)]))


def test_another_rate_is_refused():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        DisPU(Widths(refined=10, rate=3))(torch.randn(1, 7, 3), torch.randn(1, 7, 10), 4)


# --- the objective


def test_the_objective_judges_both_clouds():
    net, objective, points, true = network(8), Objective(), clouds(16), clouds(64)
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
    net, objective, points, true = network(8), Objective(ramp=2), clouds(16), clouds(64)
    weights, counted = [], []
    for _ in range(10):
        weights.append(objective.weight)
        losses = objective.losses(net, points, true, 4)
        counted.append(float(losses["fine"].detach()))
    assert weights == [0.01, 0.01, 0.1, 0.1, 0.5, 0.5, 1, 1, 1, 1]
    assert counted == pytest.approx([counted[-1] * weight for weight in weights])


def test_only_training_counts_and_the_count_is_kept():
    net, objective, points, true = network(8), Objective(ramp=2), clouds(16), clouds(64)
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


def test_gradient_reaches_every_weight():
    net, objective = network(8), Objective()
    sum(objective.losses(net, clouds(24), clouds(96), 4).values()).backward()
    for name, weight in net.named_parameters():
        if not name.endswith("key.bias"):  # softmax does not feel it: its gradient is rounding alone
            assert weight.grad is not None, name
            assert weight.grad.abs().max() > 0, name


def test_a_few_steps_bring_both_clouds_nearer():
    net, objective, points, true = network(8), Objective(ramp=5), clouds(32), clouds(128)
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
