"""Grad-PU: its parts against the network as its authors lay it out, and against what theirs computed."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn

from benchmarks.grad_pu import convert
from pcsr import Trait, UserError, Widths
from pcsr.geometry.interpolation import midpoint
from pcsr.geometry.ordering import along, hilbert_order
from pcsr.network.network import Network, build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.backbones.grad_pu import GradPU
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.linear_norm_relu import LinearNormReLU, PointNorm
from pcsr_plugins.objectives.grad_pu import GradPU as Objective
from pcsr_plugins.upsamplers.descent import STEP, Descent
from pcsr_plugins.upsamplers.shuffle import Shuffle

RECIPE = Path(__file__).parents[2] / "pcsr/recipes" / "grad-pu.yaml"
SHARED = Path(__file__).parents[3] / "shared" / "data"
"""Data that does not come with the project."""


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(5)
        yield


def close(a: torch.Tensor, b: torch.Tensor, atol: float = 1e-5) -> None:
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


def small(**options) -> Network:
    """Of the published form, but narrow."""
    return made(Mlp(Widths(), channels=6, norm="batch"), width=5, growth=4, bottleneck=3, neighbours=4, **options)


def made(encoder: Mlp, hidden=(8, 4), step=STEP, **options) -> Network:
    backbone = GradPU(Widths(visual=encoder.channels), **options)
    upsampler = Descent(Widths(refined=backbone.channels), hidden=hidden, step=step)
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def published() -> Network:
    return made(Mlp(Widths(), channels=32, norm="batch"), hidden=(64, 32, 16))


def lively(network: nn.Module) -> nn.Module:
    """Statistics and weights of the norms as training leaves them, so that each of them matters; distances above 0."""
    for module in network.modules():
        if isinstance(module, nn.modules.batchnorm._BatchNorm):
            nn.init.normal_(module.running_mean, std=0.3)
            nn.init.uniform_(module.running_var, 0.5, 2)
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, std=0.3)
    return network


def far(network: Network) -> Network:
    """One whose distances are all above 0, and none too far: every place moves."""
    nn.init.constant_(lively(network).upsampler.layers[-1].bias, 5.0)
    network.upsampler.farthest = 1e3
    return network.eval()


# --- the network as its authors lay it out: channels first, edges made, features read at the places


class Twin(nn.Module):
    """Names of its tensors as theirs."""

    def __init__(self) -> None:
        super().__init__()

        def conv(c_in, c_out, axes):
            kinds = {1: (nn.Conv1d, nn.BatchNorm1d), 2: (nn.Conv2d, nn.BatchNorm2d)}[axes]
            return nn.Sequential(kinds[0](c_in, c_out, 1), kinds[1](c_out), nn.ReLU())

        def layer(c_in):
            point_conv = {"conv_delta": conv(3, 32, 2), "conv_feats": conv(32, 32, 2), "post_conv": conv(32, 32, 2)}
            return nn.ModuleDict({"conv_bottle": conv(c_in, 32, 1), "point_conv": nn.ModuleDict(point_conv)})

        blocks = [
            nn.ModuleList(
                [
                    nn.ModuleDict({"dense_layers": nn.ModuleList(layer(c) for c in (32, 64, 96))}),
                    nn.ModuleDict({"trans": conv(128, 32, 1)}),
                ]
            )
            for _ in range(3)
        ]
        self.feature_extractor = nn.ModuleDict({"conv_init": conv(3, 32, 1), "dense_blocks": nn.ModuleList(blocks)})
        wide = (163, 64, 32, 16, 1)
        self.p2p_regressor = nn.ModuleDict({f"mlp_{i}": nn.Conv1d(wide[i], wide[i + 1], 1) for i in range(4)})

    def maps(self, points):
        """The global and the local maps of one cloud (n 3)."""
        near = torch.cdist(points, points).topk(16, largest=False).indices  # (n 16)
        x = points.T[None]  # (1 3 n)
        ways = (points[near] - points[:, None]).permute(2, 0, 1)[None]  # (1 3 n 16)
        maps = [self.feature_extractor["conv_init"](x)]
        for unit, transition in self.feature_extractor["dense_blocks"]:
            feats = maps[-1]
            for layer in unit["dense_layers"]:
                conv = layer["point_conv"]
                heard = layer["conv_bottle"](feats)[:, :, near]  # (1 32 n 16)
                new = conv["post_conv"](conv["conv_delta"](ways) * conv["conv_feats"](heard)).sum(-1)
                feats = torch.cat([feats, new], 1)
            maps.append(transition["trans"](feats))
        return maps[-1].amax(2)[0], [one[0].T for one in maps]

    def distance(self, places, points, everywhere, maps):
        """The distances of places (q 3)."""
        read = [[] for _ in maps]
        for place in places:
            apart = (points - place).norm(dim=1)
            near = apart.argsort()[:3]
            weights = 1 / (apart[near] + 1e-8)
            for rows, one in zip(read, maps, strict=True):
                rows.append((one[near] * (weights / weights.sum())[:, None]).sum(0))
        x = torch.cat([places, *(torch.stack(rows) for rows in read), everywhere.expand(len(places), -1)], 1).T[None]
        for layer in self.p2p_regressor.values():
            x = layer(x).relu()
        return x[0, 0]


@pytest.fixture
def both() -> tuple[Network, Twin]:
    """Ours and theirs, with the same weights."""
    twin, network = lively(Twin()), published()
    nn.init.constant_(twin.p2p_regressor["mlp_3"].bias, 0.3)
    network.load_state_dict(convert(twin.state_dict()))
    return network, twin


@pytest.mark.parametrize("training", [False, True])
@torch.no_grad()
def test_features_are_those_of_the_published_layout(both, training):
    network, twin = (one.train(training) for one in both)
    points = torch.randn(1, 50, 3)
    cloud, features = network.refine(points)
    everywhere, maps = twin.maps(points[0])
    assert torch.equal(cloud, points)
    close(features[0], torch.cat([*maps, everywhere.expand(50, -1)], 1), 1e-4)
    for ours, theirs in zip(network.buffers(), convert(dict(twin.named_buffers())).values(), strict=True):
        close(ours, theirs, 1e-5)  # the norms' statistics too


def test_distances_are_those_of_the_published_layout(both):
    network, twin = (one.eval() for one in both)
    points, places = torch.randn(2, 50, 3), torch.randn(2, 30, 3)
    with torch.no_grad():
        found = network.upsampler.distance(places, *network.refine(points))
        for b in range(2):
            expected = twin.distance(places[b], points[b], *twin.maps(points[b]))
            assert expected.min() > 0
            close(found[b], expected, 1e-4)


def test_the_descent_is_that_of_the_published_layout(both):
    """Of the same places; the step is theirs for 24 patches of 1024 places each."""
    network, twin = (one.eval() for one in both)
    points, start = torch.randn(1, 50, 3), torch.randn(30, 3) / 2
    with torch.no_grad():
        cloud, features = network.refine(points)
        everywhere, maps = twin.maps(points[0])
        farthest = float(twin.distance(start, points[0], everywhere, maps).median())
    network.upsampler.farthest = farthest  # half of the places are farther away
    places = start.clone()
    for _ in range(10):
        places = places.detach().requires_grad_()
        distance = twin.distance(places, points[0], everywhere, maps).clamp(max=farthest)
        of_patches = torch.cat([distance, torch.zeros(24 * 1024 - len(start))])
        of_patches.mean().backward()
        places = places - 50 * places.grad
    moved = (places - start).norm(dim=1)
    assert (moved == 0).any()
    assert (moved > 1e-5).any()
    with torch.no_grad():
        close(network.upsampler.descend(start[None], cloud, features)[0], places.detach(), 1e-5)


def test_it_has_as_many_weights_as_published():
    registry = load_plugins()
    for network in (published(), build(load(RECIPE, registry)[0], registry)):
        assert network.parameter_count == 67_073
        assert network.backbone.channels == 160
        assert network.state_dict().keys() == convert(Twin().state_dict()).keys()


# --- what the authors' network computed, with their weights


@pytest.mark.skipif(not (SHARED / "grad-pu-reference.npz").exists(), reason="the published weights are not here")
@pytest.mark.parametrize("shape", ["camel", "star"])
@torch.no_grad()
def test_the_published_weights_give_the_published_features_and_distances(shape):
    network = published()
    network.load_state_dict(convert(load_file(SHARED / "grad-pu-pugan.safetensors")))
    network.eval()
    reference = np.load(SHARED / "grad-pu-reference.npz")
    known = {key.removeprefix(f"{shape}_"): torch.from_numpy(reference[key]) for key in reference.files}
    cloud, features = network.refine(known["points"][None])
    expected = [known[f"local{i}"] for i in range(4)] + [known["global"].expand(256, -1)]
    close(features[0], torch.cat(expected, 1), 1e-4)
    close(network.upsampler.distance(known["query"][None], cloud, features)[0], known["distance"], 1e-4)


def test_a_tensor_of_another_network_is_refused():
    with pytest.raises(UserError, match=r"'feature_extractor\.conv_last\.weight' is no tensor of Grad-PU"):
        convert({"feature_extractor.conv_last.weight": torch.zeros(1)})


# --- the parts


@pytest.mark.parametrize("shape", [(3, 7), (2, 5, 7), (2, 5, 4, 7)])
@pytest.mark.parametrize("training", [False, True])
def test_the_norm_is_a_batch_norm_over_all_but_the_channels(shape, training):
    ours, plain = (lively(kind(7)).train(training) for kind in (PointNorm, nn.BatchNorm1d))
    plain.load_state_dict(ours.state_dict())
    x = torch.randn(shape)
    close(ours(x).reshape(-1, 7), plain(x.reshape(-1, 7)))
    close(ours.running_var, plain.running_var)


@pytest.mark.parametrize("shape", [(3, 7), (2, 5, 4, 7)])
@pytest.mark.parametrize("training", [False, True])
def test_the_norm_is_part_of_the_linear_layer_where_it_may_be(shape, training):
    layer, x = lively(LinearNormReLU(7, 5)).train(training), torch.randn(shape)
    linear, norm, found = layer.linear, layer.norm, layer(x)
    expected = nn.functional.batch_norm(
        linear(x).reshape(-1, 5),
        None if training else norm.running_mean,
        None if training else norm.running_var,
        *(norm.weight, norm.bias),
        training=training,
    )
    close(found, expected.relu().view(found.shape))


def test_without_a_norm_the_encoder_keeps_its_weights_names():
    assert list(Mlp(Widths()).state_dict()) == ["layer.0.weight", "layer.0.bias"]


@pytest.mark.parametrize("training", [False, True])
@torch.no_grad()
def test_backbone_follows_a_permutation(training):
    network, points, shuffled = lively(small()).train(training), torch.randn(2, 20, 3), torch.randperm(20)
    close(network.refine(points[:, shuffled])[1], network.refine(points)[1][:, shuffled], 1e-4)


@torch.no_grad()
def test_where_a_cloud_is_does_not_matter_to_the_convolutions_but_to_the_encoder():
    network, points, features = lively(small()).eval(), torch.randn(1, 20, 3), torch.randn(1, 20, 6)
    close(network.backbone(points + 1, features), network.backbone(points, features), 1e-4)
    assert (network.refine(points + 1)[1] - network.refine(points)[1]).abs().max() > 1e-2


@pytest.mark.parametrize("rate", [1, 2, 4, 16])
def test_one_instance_serves_every_rate_and_starts_at_the_midpoints(rate):
    network, points = lively(small()).eval(), torch.randn(2, 20, 3)
    assert {Trait.ANY_RATE, Trait.PERMUTATION_EQUIVARIANT} <= network.upsampler.traits
    start = network.upsampler.prepare(points, rate)
    ordered = along(hilbert_order(points), points)
    passes = 2 if rate == 16 else 1
    for b in range(2):
        cloud = ordered[b].double().numpy()
        expected = points[b] if rate == 1 else torch.from_numpy(midpoint(cloud, rate, passes)).float()
        assert torch.equal(start[b], expected)
    network.upsampler.step = 0.0
    dense = network.upsampler(points, network.refine(points)[1], rate).detach()
    assert torch.equal(dense, ordered if rate == 1 else start)


def uphill(network: Network) -> Network:
    """One whose distance is that from the plane z = −1, wherever features say."""
    with torch.no_grad():
        for layer in network.upsampler.layers:
            layer.weight.zero_()
            layer.bias.zero_()
            layer.weight[0, 0] = 1.0
        network.upsampler.layers[0].weight[0, :3] = torch.tensor([0.0, 0.0, 1.0])
        network.upsampler.layers[0].weight[0, 3:] = 0.0
        network.upsampler.layers[0].bias[0] = 1.0
    return network


def test_points_go_down_to_where_the_distance_is_0_each_by_its_own_step():
    network = uphill(small(step=0.01)).eval()
    for count in (1, 30):
        places = torch.rand(2, count, 3) * 0.15 - torch.tensor([0.0, 0.0, 1.0])  # 0 to 0.15 above the plane
        cloud, features = network.refine(torch.randn(2, 20, 3))
        moved = network.upsampler.descend(places, cloud, features).detach()
        close(moved[..., :2], places[..., :2], 1e-7)
        height = places[..., 2] + 1
        close(moved[..., 2], places[..., 2] - 0.01 * torch.ceil(height / 0.01).clamp_max(10), 1e-6)


def test_what_is_too_far_away_stays():
    network = uphill(small(step=0.01)).eval()
    cloud, features = network.refine(torch.randn(1, 20, 3))
    for height, moves in ((0.19, True), (0.21, False)):
        places = torch.tensor([[[0.0, 0.0, height - 1]]])
        assert torch.equal(network.upsampler.descend(places, cloud, features), places) is not moves


@pytest.mark.parametrize("rate", [1, 4])
@torch.no_grad()
def test_the_order_of_the_points_does_not_matter(rate):
    network, points, shuffled = far(small(step=0.05)), torch.randn(2, 30, 3), torch.randperm(30)
    close(network(points[:, shuffled], rate), network(points, rate), 1e-5)


@pytest.mark.parametrize("mode", [torch.no_grad, torch.inference_mode])
@pytest.mark.parametrize("rate", [1, 4])
def test_it_descends_whether_gradients_are_recorded_or_not(mode, rate):
    network, points = far(small(step=0.05)).double(), torch.randn(2, 20, 3).double()
    recorded = network(points, rate)
    assert recorded.requires_grad
    with mode():
        silent = network(points * 1.0, rate)
    assert not silent.requires_grad
    assert not points.requires_grad
    close(silent, recorded.detach(), 1e-10)
    network.upsampler.step = 0.0
    assert (silent - network(points, rate)).abs().max() > 1e-4


@pytest.mark.parametrize("seed", range(10))
@torch.no_grad()
def test_untrained_it_gives_no_place_the_distance_0_from_where_nothing_is_learned(seed):
    torch.manual_seed(seed)
    network, points = small(), torch.randn(2, 40, 3)
    assert network.upsampler.distance(points, *network.refine(points)).min() > 0


@pytest.mark.parametrize("rate", [1, 4])
def test_where_gradients_are_recorded_the_result_has_one_by_the_features(rate):
    network = far(small(step=0.1))
    points = torch.randn(1, 20, 3)
    features = network.refine(points)[1].detach().requires_grad_()
    network.upsampler(points, features, rate).square().sum().backward()
    assert features.grad.isfinite().all()
    assert features.grad.abs().max() > 0


# --- the objective


def test_the_objective_is_the_error_of_the_distances_of_noisy_midpoints():
    network, objective = lively(small()).eval(), Objective(sigma=0.1)
    points, truth = torch.randn(2, 20, 3), torch.randn(2, 50, 3)
    torch.manual_seed(11)  # of no consequence
    with torch.no_grad():
        (name, loss), *others = objective.losses(network, points, truth, 4).items()
    noise = 0.1 * torch.randn(2, 80, 3, generator=torch.Generator().manual_seed(0))
    start = network.upsampler.prepare(points, 4)
    places = start + noise
    with torch.no_grad():
        predicted = network.upsampler.distance(places, *network.refine(start))
    expected = 0.0
    for b in range(2):
        for i in range(80):
            true = min(float((places[b, i] - point).norm()) for point in truth[b])
            expected += abs(float(predicted[b, i]) - true) / 2
    assert name == "distance"
    assert not others
    assert float(loss) == pytest.approx(expected, rel=1e-4)


def test_its_noise_changes_from_batch_to_batch_and_goes_on_where_a_checkpoint_left_it():
    network, objective = small().eval(), Objective()
    clouds = torch.randn(2, 20, 3), torch.randn(2, 50, 3)
    with torch.no_grad():
        before = [float(objective.losses(network, *clouds, 4)["distance"]) for _ in range(2)]
        resumed = Objective()
        resumed.load_state_dict(objective.state_dict())
        after = [float(one.losses(network, *clouds, 4)["distance"]) for one in (objective, resumed)]
        assert len({*before, after[0]}) == 3
        assert after[0] == after[1]
        still = [float(objective.eval().losses(network, *clouds, 4)["distance"]) for _ in range(2)]
        assert still[0] == still[1]


def test_an_upsampler_without_distances_is_refused():
    network = small()
    network.upsampler = Shuffle(Widths(refined=24, rate=4))
    with pytest.raises(UserError, match=r"upsampler Shuffle predicts none: set model\.upsampler to descent"):
        Objective().losses(network, torch.randn(1, 20, 3), torch.randn(1, 50, 3), 4)


def test_a_few_steps_lower_the_loss_and_reach_all_weights():
    network, objective = small(), Objective()
    truth = nn.functional.normalize(torch.randn(4, 200, 3), dim=-1)
    points = truth[:, :50]
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
    values = []
    for step in range(60):
        loss = objective.losses(network, points, truth, 4)["distance"]
        optimizer.zero_grad()
        loss.backward()
        if step == 0:
            reached = {name: weight.grad.abs().max() > 0 for name, weight in network.named_parameters()}
            assert all(reached.values()), reached
        optimizer.step()
        values.append(float(loss.detach()))
    assert sum(values[-5:]) < 0.8 * sum(values[:5])
