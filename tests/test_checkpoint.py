"""Weights and the state of training, to a file and back."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from pcsr.checkpoint import fill, load_training, load_weights, read_card, save_training, save_weights
from pcsr.errors import UserError
from pcsr.model import build
from pcsr.plugins import load_plugins
from pcsr.recipe import Recipe, load

SMOKE = Path(__file__).parents[1] / "recipes" / "smoke.yaml"


def recipe(*overrides: str) -> Recipe:
    (only,) = load(SMOKE, load_plugins(), ["model.encoder.channels=16", "model.backbone.channels=[8, 16]", *overrides])
    return only


@pytest.fixture
def saved(tmp_path):
    network = build(recipe(), load_plugins())
    path = tmp_path / "weights.safetensors"
    save_weights(path, network, {"recipe": recipe().resolved(), "metrics": {"cd": 0.125}})
    return path, network


def test_weights_come_back_bit_for_bit(saved):
    path, network = saved
    loaded, its_recipe, card = load_weights(path, load_plugins())
    assert its_recipe == recipe()
    assert card["metrics"] == {"cd": 0.125}
    assert not loaded.training
    before, after = network.state_dict(), loaded.state_dict()
    assert before.keys() == after.keys()
    assert all(torch.equal(before[name], after[name]) for name in before)


def test_the_weights_that_come_back_are_those_of_the_file_not_of_the_seed(saved):
    path, network = saved
    with torch.no_grad():
        for weight in network.parameters():
            weight.add_(1)
    save_weights(path, network, {"recipe": recipe().resolved()})
    loaded = load_weights(path, load_plugins())[0]
    assert all(torch.equal(a, b) for a, b in zip(network.parameters(), loaded.parameters(), strict=True))


def test_the_card_is_read_alone_and_no_temporary_file_stays(saved):
    path, _ = saved
    assert read_card(path) == {"recipe": recipe().resolved(), "metrics": {"cd": 0.125}}
    assert list(path.parent.iterdir()) == [path]


def test_weights_of_another_shape_are_named(saved):
    path, network = saved
    save_weights(path, network, {"recipe": recipe("model.upsampler.hidden=24").resolved()})
    with pytest.raises(UserError, match=r"upsampler\.mlp\.0\.weight is \(16, 4\), not \(24, 4\)") as caught:
        load_weights(path, load_plugins())
    assert str(path) in str(caught.value)


def test_missing_and_unknown_weights_are_named_and_nothing_is_changed():
    network = torch.nn.Linear(2, 1)
    before = network.weight.clone()
    tensors = {"weight": torch.zeros(1, 2), "bias2": torch.zeros(1)}
    with pytest.raises(UserError, match=r"in here do not fit .*: bias is missing; bias2 is unknown\."):
        fill(network, tensors, Path("here"))
    assert torch.equal(network.weight, before)


def test_of_many_misfits_three_are_named():
    with pytest.raises(UserError, match=r"0 is unknown; 1 is unknown; 2 is unknown and 4 more\."):
        fill(torch.nn.Identity(), {str(i): torch.zeros(1) for i in range(7)}, Path("here"))


@pytest.mark.parametrize("damage", ["cut", "header", "empty", "text"])
def test_a_damaged_file_is_refused(saved, damage):
    path, _ = saved
    content = path.read_bytes()
    damaged = {"cut": content[:-100], "header": b"\xff" * 8 + content[8:], "empty": b"", "text": b"hello" * 100}
    path.write_bytes(damaged[damage])
    with pytest.raises(UserError, match="is not a weights file of pcsr") as caught:
        load_weights(path, load_plugins())
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("metadata", [None, {"format": "pt"}, {"pcsr": "{"}])
def test_a_safetensors_file_of_others_is_refused(tmp_path, metadata):
    save_file({"weight": torch.zeros(2)}, tmp_path / "other.safetensors", metadata)
    with pytest.raises(UserError, match="is not a weights file of pcsr"):
        read_card(tmp_path / "other.safetensors")


def test_a_card_without_recipe_is_refused(saved):
    path, network = saved
    save_weights(path, network, {"metrics": {}})
    with pytest.raises(UserError, match=r"weights\.safetensors"):
        load_weights(path, load_plugins())


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(UserError, match="there is no such weights file"):
        load_weights(tmp_path / "none.safetensors", load_plugins())


@pytest.mark.parametrize("kind", [torch.optim.Adam, torch.optim.AdamW])
def test_training_goes_on_as_if_never_saved(tmp_path, kind):
    def step(network, optimizer):
        optimizer.zero_grad()
        network(torch.arange(6.0).view(2, 3)).square().sum().backward()
        optimizer.step()

    torch.manual_seed(0)
    network = torch.nn.Linear(3, 2)
    optimizer = kind(network.parameters(), lr=0.1)
    step(network, optimizer)
    path, about = tmp_path / "checkpoint.safetensors", {"step": 1, "seconds": 0.5}
    save_training(path, network, optimizer, about)
    other = torch.nn.Linear(3, 2)
    restored = kind(other.parameters(), lr=0.1)
    assert load_training(path, other, restored) == about
    for _ in range(3):
        step(network, optimizer)
        step(other, restored)
    assert torch.equal(network.weight, other.weight)
    assert json.dumps(about) in json.dumps(read_card(path))
