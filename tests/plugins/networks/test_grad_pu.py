"""Grad-PU against the network as its authors lay it out, and against what theirs computed."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn

import pcsr
from benchmarks.grad_pu import convert
from pcsr import UserError
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.objectives.grad_pu import GradPU as Objective
from tests.plugins.compare import close
from tests.plugins.published import grad_pu, lively, small_grad_pu

RECIPE = Path(pcsr.__file__).parent / "recipes" / "grad-pu.yaml"
SHARED = Path(__file__).parents[4] / "shared" / "data"
"""Data that does not come with the project."""


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
        offsets = (points[near] - points[:, None]).permute(2, 0, 1)[None]  # (1 3 n 16)
        maps = [self.feature_extractor["conv_init"](x)]
        for unit, transition in self.feature_extractor["dense_blocks"]:
            feats = maps[-1]
            for layer in unit["dense_layers"]:
                conv = layer["point_conv"]
                messages = layer["conv_bottle"](feats)[:, :, near]  # (1 32 n 16)
                new = conv["post_conv"](conv["conv_delta"](offsets) * conv["conv_feats"](messages)).sum(-1)
                feats = torch.cat([feats, new], 1)
            maps.append(transition["trans"](feats))
        return maps[-1].amax(2)[0], [one[0].T for one in maps]

    def distance(self, candidates, points, everywhere, maps):
        """The distances of positions (q 3)."""
        read = [[] for _ in maps]
        for place in candidates:
            apart = (points - place).norm(dim=1)
            near = apart.argsort()[:3]
            weights = 1 / (apart[near] + 1e-8)
            for rows, one in zip(read, maps, strict=True):
                rows.append((one[near] * (weights / weights.sum())[:, None]).sum(0))
        x = torch.cat([candidates, *(torch.stack(rows) for rows in read), everywhere.expand(len(candidates), -1)], 1).T[
            None
        ]
        for layer in self.p2p_regressor.values():
            x = layer(x).relu()
        return x[0, 0]


@pytest.fixture
def both() -> tuple[Network, Twin]:
    """Ours and theirs, with the same weights."""
    torch.manual_seed(5)
    twin, network = lively(Twin()), grad_pu()
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
    points, candidates = torch.randn(2, 50, 3), torch.randn(2, 30, 3)
    with torch.no_grad():
        found = network.upsampler.distance(candidates, *network.refine(points))
        for b in range(2):
            expected = twin.distance(candidates[b], points[b], *twin.maps(points[b]))
            assert expected.min() > 0
            close(found[b], expected, 1e-4)


def test_the_descent_is_that_of_the_published_layout(both):
    """Of the same positions; the step is theirs for 24 patches of 1024 positions each."""
    network, twin = (one.eval() for one in both)
    points, start = torch.randn(1, 50, 3), torch.randn(30, 3) / 2
    with torch.no_grad():
        cloud, features = network.refine(points)
        everywhere, maps = twin.maps(points[0])
        farthest = float(twin.distance(start, points[0], everywhere, maps).median())
    network.upsampler.farthest = farthest  # half of the positions are farther away
    candidates = start.clone()
    for _ in range(10):
        candidates = candidates.detach().requires_grad_()
        distance = twin.distance(candidates, points[0], everywhere, maps).clamp(max=farthest)
        of_patches = torch.cat([distance, torch.zeros(24 * 1024 - len(start))])
        of_patches.mean().backward()
        candidates = candidates - 50 * candidates.grad
    moved = (candidates - start).norm(dim=1)
    assert (moved == 0).any()
    assert (moved > 1e-5).any()
    with torch.no_grad():
        close(network.upsampler.descend(start[None], cloud, features)[0], candidates.detach(), 1e-5)


def test_it_has_as_many_weights_as_published():
    registry = load_plugins()
    for network in (grad_pu(), build(load(RECIPE, registry)[0], registry)):
        assert network.parameter_count == 67_073
        assert network.backbone.channels == 160
        assert network.state_dict().keys() == convert(Twin().state_dict()).keys()


@pytest.mark.skipif(not (SHARED / "grad-pu-reference.npz").exists(), reason="the published weights are not here")
@pytest.mark.parametrize("shape", ["camel", "star"])
@torch.no_grad()
def test_the_published_weights_give_the_published_features_and_distances(shape):
    network = grad_pu()
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


@pytest.mark.slow
def test_a_few_steps_lower_the_loss_and_reach_all_weights():
    torch.manual_seed(5)
    network, objective = small_grad_pu(), Objective()
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
