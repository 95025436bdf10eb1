"""Weights in half precision."""

import re

import pytest
import torch
from safetensors.torch import load_file

from pcsr.errors import UserError
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.weights.file import read_card, tensors_hash
from tests.saved_weights import recipe, save


@pytest.fixture
def saved(tmp_path):
    return save(tmp_path)


def test_half_precision_takes_half_the_space_and_comes_back_in_single(saved):
    path, network = saved
    network.register_buffer("steps", torch.tensor(2**40))
    halved = path.with_name("half.safetensors")
    card = {"recipe": recipe().resolved()}
    save_weights(path, network, card)
    save_weights(halved, network, card, half=True)
    stored, whole = load_file(halved), load_file(path)
    assert stored["steps"] == 2**40
    assert {tensor.dtype for name, tensor in stored.items() if name != "steps"} == {torch.float16}
    sizes = [sum(tensor.nbytes for name, tensor in some.items() if name != "steps") for some in (stored, whole)]
    assert 2 * sizes[0] == sizes[1]
    assert read_card(halved)["sha256"] == tensors_hash(stored)
    del network.steps
    save_weights(halved, network, card, half=True)
    loaded = load_weights(halved, load_plugins())[0]
    for name, tensor in loaded.state_dict().items():
        assert tensor.dtype == network.state_dict()[name].dtype
        if tensor.is_floating_point():
            torch.testing.assert_close(tensor, network.state_dict()[name], rtol=2**-11, atol=2**-24)
            assert torch.equal(tensor, network.state_dict()[name].half().float())
    assert {parameter.dtype for parameter in loaded.parameters()} == {torch.float32}


def test_the_network_itself_stays_as_it_was_when_its_weights_are_halved(saved):
    path, network = saved
    before = {name: tensor.clone() for name, tensor in network.state_dict().items()}
    save_weights(path, network, {}, half=True)
    assert all(torch.equal(before[name], tensor) for name, tensor in network.state_dict().items())


def test_a_weight_too_large_for_half_precision_is_named_and_nothing_is_written(saved):
    path, network = saved
    before, name = path.read_bytes(), next(name for name, _ in network.named_parameters())
    with torch.no_grad():
        network.get_parameter(name).view(-1)[0] = -1e5
    with pytest.raises(UserError, match=rf"'{re.escape(name)}' reach 1e\+05, and half precision ends at 65504: store"):
        save_weights(path, network, {}, half=True)
    assert path.read_bytes() == before
