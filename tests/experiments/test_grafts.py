"""Training of grafts on foreign networks: what is trained, what stays, and what is refused before it begins."""

import re
import shutil

import pytest
import torch
from safetensors.torch import save_file

from pcsr.contracts import TouchBatch
from pcsr.errors import UserError
from pcsr.experiments.environment import plugin_files
from pcsr.experiments.run import check_graft
from pcsr.experiments.train import initial
from pcsr.grafting.description import described
from pcsr.network.build import build
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from tests.foreign_networks import FOLDER, network
from tests.small_training import SMOKE, STEPS, history, same, stop_at, trained

RECIPE = f"""\
extends: {SMOKE.as_posix()}
name: tiny
data: {{touches: 1, points: 24, touch: {{points: 16}}}}
model:
  graft:
    network: cascade.py:Cascade
    options: {{channels: 8}}
    at: second.features
    touch_encoder: {{use: mlp, channels: 4}}
train: {{epochs: 4, batch: 3, touches: [0, 2]}}
"""
KERNEL = ["model.graft.network=kernel_upsampler.py:network", "model.graft.at=encoder.fuse"]


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Read the recipe of a graft, and return it with its registry."""
    for file in FOLDER.glob("*.py"):
        shutil.copy(file, tmp_path)
    (tmp_path / "tiny.yaml").write_text(RECIPE)
    monkeypatch.chdir(tmp_path)

    def made(*overrides):
        registry = load_plugins()
        (recipe,) = load(tmp_path / "tiny.yaml", registry, overrides)
        return recipe, registry

    return made


@pytest.mark.parametrize("overrides", [[], KERNEL])
def test_a_graft_is_trained_with_its_network(read, tmp_path, overrides):
    recipe, registry = read(*overrides)
    before = build(recipe, registry)
    after = trained(recipe, tmp_path / "run", registry=registry)
    assert not after.training
    file = recipe.model.graft.network.partition(":")[0]
    assert [path.name for path in plugin_files(recipe, registry).values()] == [file], "copied to the run folder"
    assert len([line for line in history(tmp_path / "run") if "loss" in line]) == STEPS
    moved = {name for name, tensor in after.state_dict().items() if not torch.equal(tensor, before.state_dict()[name])}
    assert {"network", "fusion", "touch_encoder"} == {name.partition(".")[0] for name in moved}
    assert any(name.endswith("running_mean") for name in moved)
    assert "network.decoder.kernel" not in moved, "its author does not train it"


def test_a_frozen_network_stays_as_it_was_in_batches_without_touches_too(read, tmp_path):
    theirs = network("cascade", seed=3).__class__(channels=8)
    save_file(
        {f"module.{name}": tensor for name, tensor in theirs.state_dict().items()}, tmp_path / "theirs.safetensors"
    )
    recipe, registry = read("model.graft.weights=theirs.safetensors")
    after = trained(recipe, tmp_path / "run", registry=registry)
    assert all(torch.equal(after.network.state_dict()[name], tensor) for name, tensor in theirs.state_dict().items())
    points = torch.rand(2, 24, 3) - 0.5
    assert torch.equal(after(points, 4), theirs.eval()(points.transpose(1, 2).contiguous()))
    before = initial(recipe, registry)
    assert not same(before.fusion, after.fusion)
    assert before.network.training is after.network.training is False


@pytest.mark.parametrize("average", ["ema", "swa"])
def test_averages_clipping_and_early_stopping_leave_a_frozen_network_as_it_was(read, tmp_path, average):
    theirs = network("cascade", seed=3).__class__(channels=8)
    save_file(theirs.state_dict(), tmp_path / "theirs.safetensors")
    settings = (f"average={average}", "clip_norm=0.1", "validate_every=1", "patience=4")
    recipe, registry = read("model.graft.weights=theirs.safetensors", *(f"train.{one}" for one in settings))
    after = trained(recipe, tmp_path / "run", registry=registry)
    assert all(torch.equal(after.network.state_dict()[name], tensor) for name, tensor in theirs.state_dict().items())
    assert not same(initial(recipe, registry).fusion, after.fusion)
    assert not after.training


def test_a_training_that_was_interrupted_goes_on_to_the_same_weights(read, tmp_path):
    recipe, registry = read()
    whole = trained(recipe, tmp_path / "whole", registry=registry)
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "parts", registry=registry, shown=stop_at(3), checkpoint_every=0.0)
    resumed = trained(recipe, tmp_path / "parts", registry=registry)
    assert all(
        torch.equal(a, b) for a, b in zip(whole.state_dict().values(), resumed.state_dict().values(), strict=True)
    )


RANDOM = """\
import random

import numpy as np
import torch
from torch import nn

class Random(nn.Module):
    \"""It draws from the states of torch, numpy and Python: initial weights, dropout, and a random first point.\"""

    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(3, 8)
        self.fixed = nn.Parameter(torch.tensor(np.random.rand(8, 12) - random.random()).float())
        self.dropout = nn.Dropout(0.5)

    def forward(self, points):
        first = points[:, torch.randint(points.shape[1], (1,))]
        offsets = self.dropout(self.layer(points - first)) @ self.fixed
        return (points.unsqueeze(2) + offsets.unflatten(2, (4, 3))).flatten(1, 2)
"""


def test_a_network_that_draws_random_numbers_depends_on_the_seed_alone(read, tmp_path):
    (tmp_path / "random_network.py").write_text(RANDOM)
    recipe, registry = read(
        "model.graft.network=random_network.py:Random", "model.graft.options={}", "model.graft.at=layer"
    )
    assert same(build(recipe, registry), build(recipe, registry))
    whole = trained(recipe, tmp_path / "whole", registry=registry)
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "parts", registry=registry, shown=stop_at(3), checkpoint_every=0.0)
    resumed = trained(recipe, tmp_path / "parts", registry=registry)
    assert same(whole, resumed)
    points = torch.rand(2, 24, 3)
    state = torch.get_rng_state()
    assert torch.equal(whole(points, 4), whole(points, 4))
    assert torch.equal(torch.get_rng_state(), state)


SQUEEZING = """\
import torch
from torch import nn

class Squeezing(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer, self.norm, self.head = nn.Conv1d(3, 8, 1), nn.BatchNorm1d(8), nn.Conv1d(8, 12, 1)

    def forward(self, points):
        features = self.norm(self.layer(points.transpose(1, 2)).unsqueeze(3).squeeze())
        return points.repeat(1, 4, 1) + self.head(features).unflatten(1, (3, 4)).flatten(2).transpose(1, 2)
"""


def test_a_network_that_fails_on_one_cloud_is_trained_and_used(read, tmp_path):
    """Validation, and the upsampling of a cloud of one patch, have batches of one."""
    (tmp_path / "squeezing.py").write_text(SQUEEZING)
    recipe, registry = read("model.graft={network: squeezing.py:Squeezing, at: layer, fusion: concat}")
    after = trained(recipe, tmp_path / "run", registry=registry)
    points, touches = torch.rand(2, 24, 3) - 0.5, (torch.rand(2, 2, 16, 3) - 0.5) / 5
    mask = torch.tensor([[True, False], [True, True]])
    both = after(points, 4, TouchBatch.of(touches, mask))
    for row in range(2):
        alone = after(points[row : row + 1], 4, TouchBatch.of(touches[row : row + 1], mask[row : row + 1]))
        torch.testing.assert_close(alone[0], both[row])
    assert after(points[:1], 4).shape == (1, 96, 3)


DESCENT = """\
import torch
from torch import nn

class Descent(nn.Module):
    \"""It moves its points down a learned distance, in training as at inference.\"""

    def __init__(self):
        super().__init__()
        self.layer, self.head = nn.Linear(3, 8), nn.Linear(11, 1)

    def forward(self, points):
        with torch.enable_grad():
            features = self.layer(points).repeat(1, 4, 1)
            start = points.repeat(1, 4, 1).detach().requires_grad_(True)
            distance = self.head(torch.cat([features, start], 2).sin()).square().sum()
            (gradient,) = torch.autograd.grad(distance, start, create_graph=self.training)
        return start - 0.1 * gradient
"""


def test_a_network_that_follows_a_gradient_is_trained_and_used(read, tmp_path):
    (tmp_path / "descent.py").write_text(DESCENT)
    recipe, registry = read("model.graft={network: descent.py:Descent, at: layer, fusion: concat}")
    after = trained(recipe, tmp_path / "run", registry=registry)
    points, touches = torch.rand(2, 24, 3) - 0.5, TouchBatch.of((torch.rand(2, 2, 16, 3) - 0.5) / 5)
    with torch.inference_mode():  # as in `pcsr upsample`
        dense = after(points, 4, touches)
    assert torch.equal(dense, after(points, 4, touches))
    assert not torch.equal(dense, after(points, 4))
    assert not dense.requires_grad


def test_intermediate_clouds_are_the_stages_of_the_network(read):
    recipe, registry = read()
    grafted = build(recipe, registry).train()
    sizes = [cloud.shape[1] for cloud in grafted.stages(torch.rand(2, 24, 3), 4)]
    assert sizes == [48, 96, 96]
    assert [cloud.shape[1] for cloud in grafted.eval().stages(torch.rand(2, 24, 3), 4)] == [96]


def test_weights_of_a_run_come_back_with_the_file_of_the_network_alone(read, tmp_path):
    recipe, registry = read()
    grafted = build(recipe, registry).eval()
    path = tmp_path / "weights.safetensors"
    save_weights(path, grafted, {"recipe": recipe.resolved(), "graft": described(grafted)}, registry)
    loaded, _, _ = load_weights(path, load_plugins([tmp_path / "cascade.py"]))
    assert same(grafted, loaded)
    assert loaded.injection_point == grafted.injection_point
    points = torch.rand(1, 24, 3)
    assert torch.equal(loaded(points, 4), grafted(points, 4))
    with pytest.raises(UserError, match=r"need the network 'Cascade' of the file cascade\.py: hand in that file"):
        load_weights(path, load_plugins())
    copy = tmp_path / "plugins" / "cascade" / "cascade.py"
    copy.parent.mkdir(parents=True)
    shutil.copy(tmp_path / "cascade.py", copy)
    with pytest.raises(UserError, match=f"of which the run has a copy, {re.escape(str(copy))}"):
        load_weights(path, load_plugins())
    (tmp_path / "cascade.py").write_text(
        (tmp_path / "cascade.py").read_text().replace("nn.Conv1d(3, c", "nn.Conv1d(3, 2 * c")
    )
    with (
        pytest.warns(UserWarning, match="made by the network cascade"),
        pytest.raises(
            UserError, match=r"network\.first\.features\.point\.0\.bias is \(8,\) in the file, \(16,\) in the"
        ),
    ):
        load_weights(path, load_plugins([tmp_path / "cascade.py"]))


FAULTS = """\
import torch
from torch import nn

class Raises(nn.Module):
    def __init__(self):
        raise ValueError("no\\nluck")

class Ends(nn.Module):
    def __init__(self):
        raise SystemExit(2)  # as argparse does

class NeedsCuda(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(3, 8).cuda()

class NoCloud(nn.Module):
    def __init__(self):
        super().__init__()
        self.features = nn.Linear(3, 8)

    def forward(self, points):
        return self.features(points)

def nothing() -> nn.Module:
    return 7
"""


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["model.graft.at=secnd.features"],
            r"no layer 'secnd\.features': did you mean .*'second\.features'.*\? It can be",
        ),
        (["model.graft.at=copies"], r"no layer 'copies': did you mean 'first\.copies' or"),
        (
            ["model.graft.options={rate: 16}"],
            r"Cascade makes 16 points of each, and the recipe asks for 4: set data\.rate",
        ),
        (["model.graft.network=faults.py:Raises"], r"faults\.py:Raises cannot be built with \{\}: ValueError: no luck"),
        (["model.graft.network=faults.py:Ends"], r"faults\.py:Ends cannot be built with \{\}: SystemExit: 2"),
        (["model.graft.network=faults.py:nothing"], r"faults\.py:nothing gives 7, not a torch\.nn\.Module"),
        (["model.graft.network=faults.py:NoCloud", "model.graft.at=features"], r"NoCloud gives no cloud"),
        (
            ["model.graft.weights=other.safetensors"],
            r"the weights in .*other\.safetensors do not fit this Cascade: .*\. Name",
        ),
        (
            ["model.graft.weights=pickle.pth"],
            r"pickle\.pth is no safetensors file, and pcsr unpickles nothing: convert it",
        ),
        pytest.param(
            ["model.graft.network=faults.py:NeedsCuda"],
            r"NeedsCuda cannot be built .* It needs a CUDA device, and there is none here",
            marks=pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device"),
        ),
    ],
)
def test_what_cannot_be_grafted_is_one_line_before_the_data_are_built(read, tmp_path, overrides, message):
    (tmp_path / "faults.py").write_text(FAULTS)
    save_file(network("cascade").state_dict(), tmp_path / "other.safetensors")
    torch.save({"a": torch.zeros(1)}, tmp_path / "pickle.pth")
    recipe, registry = read(*overrides)
    with pytest.raises(UserError, match=rf"^recipe 'tiny': .*{message}") as caught:
        check_graft(recipe, registry)
    assert "\n" not in str(caught.value)


def test_an_objective_that_needs_features_is_refused(read, tmp_path):
    recipe, registry = read("train.objective=surface-passes")
    with pytest.raises(UserError, match="the objective needs features of the network"):
        trained(recipe, tmp_path / "run", registry=registry)
