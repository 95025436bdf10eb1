"""benchmarks/exchanged_features.py: errors with features of another cloud, of networks that use features or not."""

import importlib
from pathlib import Path

import pytest
import torch
from click.testing import CliRunner

from pcsr.errors import UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.network.save import save_weights
from tests.small_training import split, tiny, varied

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    features = importlib.import_module("exchanged_features")
OBJECTS = split(3, 5)


@pytest.fixture
def recipe(tmp_path):
    return tiny(tmp_path, "model.upsampler.start=neighbours")


@pytest.fixture
def network(recipe):
    return varied(recipe)


def test_each_cloud_gets_the_features_of_another_one_and_keeps_its_coordinates(recipe, network):
    count, own, exchanged = features.measure(network, recipe, OBJECTS)
    batch = features.Batches(OBJECTS, 3, (0, 0), (), seed=0).at(0)
    with torch.inference_mode():
        of_each = network.encoder(batch.points)
        for found, order in ((own, [0, 1, 2]), (exchanged, [2, 0, 1])):
            dense = network.upsampler(batch.points, network.backbone(batch.points, of_each[order]), 4)
            assert found == pytest.approx(float(chamfer(dense, batch.truth).mean()), rel=1e-5)
    assert count == 3
    assert own != exchanged


def test_a_network_that_ignores_its_features_has_the_same_error(recipe, network):
    with torch.no_grad():
        for encoder in network.backbone.encoders[:1]:
            encoder.position.features.edge.weight.zero_()
    _, own, exchanged = features.measure(network, recipe, OBJECTS)
    assert own == exchanged


def test_one_object_alone_is_refused(recipe, network):
    with pytest.raises(UserError, match="the test split has one object, and none to exchange features with"):
        features.measure(network, recipe, split(1, 5))


def test_the_command_takes_names_and_files(recipe, network, tmp_path, monkeypatch):
    monkeypatch.setattr(features.Split, "load", lambda folder, name: OBJECTS)
    save_weights(tmp_path / "mine.safetensors", network, {"name": "tiny", "recipe": recipe.resolved()})
    done = CliRunner().invoke(features.main, [str(tmp_path), str(tmp_path / "mine.safetensors")])
    assert done.exit_code == 0, done.output
    assert "| `tiny`  | 3 clouds |" in done.output
    wrong = CliRunner().invoke(features.main, [str(tmp_path), "nothing"])
    assert wrong.exit_code == 1
    assert "nothing" in wrong.output
