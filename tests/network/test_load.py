"""Weights to a file and back."""

import hashlib
import json
from functools import partial

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.torch import load_file, save_file

from pcsr.errors import UserError
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.weights.file import read_card, tensors_hash
from tests.saved_weights import plugins, recipe, refusal, save


@pytest.fixture
def saved(tmp_path):
    return save(tmp_path)


def test_weights_come_back_bit_for_bit(saved):
    path, network = saved
    loaded, its_recipe, card = load_weights(path, load_plugins())
    assert its_recipe.resolved() == recipe().resolved()
    assert its_recipe.model == recipe().model
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
    path, network = saved
    sha256 = tensors_hash(network.state_dict())
    assert read_card(path) == {"recipe": recipe().resolved(), "metrics": {"cd": 0.125}, "sha256": sha256}
    assert list(path.parent.iterdir()) == [path]


def test_weights_of_another_shape_are_named(saved):
    path, network = saved
    save_weights(path, network, {"recipe": recipe("model.upsampler.hidden=24").resolved()})
    with pytest.raises(
        UserError, match=r"upsampler\.mlp\.0\.weight is \(16, 4\) in the file, \(24, 4\) in the network"
    ) as caught:
        load_weights(path, load_plugins())
    assert f"{path} do not fit this Network: upsampler." in str(caught.value)


@pytest.mark.parametrize("damage", ["cut", "header", "empty", "text"])
def test_a_damaged_file_is_refused(saved, damage):
    path, _ = saved
    content = path.read_bytes()
    damaged = {"cut": content[:-100], "header": b"\xff" * 8 + content[8:], "empty": b"", "text": b"hello" * 100}
    path.write_bytes(damaged[damage])
    for read in (partial(load_weights, registry=load_plugins()), read_card):
        with pytest.raises(UserError, match="is not a weights file of pcsr") as caught:
            read(path)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "metadata", [None, {"format": "pt"}, {"pcsr": "{"}, {"pcsr": "[1]"}, {"pcsr": "null"}, {"pcsr": "[" * 100_000}]
)
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


def test_a_folder_is_refused(tmp_path):
    assert "is a folder" in refusal(tmp_path)


def test_a_file_cut_anywhere_is_refused(tmp_path):
    path = tmp_path / "small.safetensors"
    save_weights(path, torch.nn.Linear(2, 1), {"name": "small"})
    assert "holds no recipe" in refusal(path)
    content = path.read_bytes()
    for length in range(len(content)):
        path.write_bytes(content[:length])
        assert "is not a weights file of pcsr" in refusal(path)
    path.write_bytes(content + b"\0")
    assert "is not a weights file of pcsr" in refusal(path)


FREELY = settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FREELY
@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_refused(tmp_path, content, headed):
    path = tmp_path / "bytes.safetensors"
    path.write_bytes(len(content).to_bytes(8, "little") * headed + content)
    assert "is not a weights file of pcsr" in refusal(path)


@pytest.mark.slow
@FREELY
@given(st.floats(0, 1, exclude_max=True), st.integers(1, 255))
def test_no_byte_of_the_weights_can_change_unseen(saved, place, change):
    path, network = saved
    content = bytearray(path.read_bytes())
    weights = sum(tensor.nbytes for tensor in network.state_dict().values())
    at = len(content) - 1 - int(place * weights)
    content[at] ^= change
    changed = path.with_name("changed.safetensors")
    changed.write_bytes(content)
    assert "has changed since it was written (its hash differs): get it again" in refusal(changed)


@FREELY
@given(st.data())
def test_a_header_with_a_changed_byte_loads_or_is_refused_in_one_line(saved, data):
    path, _ = saved
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, 7 + int.from_bytes(content[:8], "little")))] = data.draw(st.integers(0, 255))
    changed = path.with_name("changed.safetensors")
    changed.write_bytes(content)
    try:
        load_weights(changed, plugins())
    except UserError as error:
        assert "\n" not in str(error)  # noqa: PT017


def test_a_file_without_a_hash_is_read_as_before(saved):
    path, network = saved
    card = {key: value for key, value in read_card(path).items() if key != "sha256"}
    tensors = load_file(path)
    name = next(iter(tensors))
    tensors[name] += 1
    save_file(tensors, path, {"pcsr": json.dumps(card)})
    loaded = load_weights(path, load_plugins())[0]
    assert torch.equal(loaded.state_dict()[name], network.state_dict()[name] + 1)


def test_the_hash_is_of_names_types_shapes_and_bytes_in_the_order_of_the_names():
    tensors = {"b": torch.tensor([1.0, 2.0]), "a": torch.tensor(3, dtype=torch.int64)}
    by_hand = hashlib.sha256(
        b'["a", "torch.int64", []]\n'
        + (3).to_bytes(8, "little")
        + b'["b", "torch.float32", [2]]\n'
        + bytes.fromhex("0000803f00000040")
    ).hexdigest()
    assert tensors_hash(tensors) == tensors_hash(dict(reversed(tensors.items()))) == by_hand
    others = [
        {"b": tensors["b"]},
        {"c": tensors["b"], "a": tensors["a"]},
        {**tensors, "b": tensors["b"][None]},
        {**tensors, "b": tensors["b"].view(torch.int32)},
        {**tensors, "b": torch.tensor([1.0, -2.0])},
    ]
    assert len({by_hand, *map(tensors_hash, others)}) == 6
    square = torch.arange(6.0).view(2, 3)
    assert tensors_hash({"w": square.t()}) == tensors_hash({"w": square.t().contiguous()})


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_weights_that_are_not_finite_are_named(saved, value):
    path, network = saved
    with torch.no_grad():
        network.upsampler.mlp[0].bias[3] = value
    save_weights(path, network, {"recipe": recipe().resolved()})
    assert "its weights 'upsampler.mlp.0.bias' are not all finite" in refusal(path)
