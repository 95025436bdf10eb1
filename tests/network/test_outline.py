"""Outlines of networks: those of the real ones, without memory, and an end to what has too many layers."""

import threading
from pathlib import Path

import pytest
import torch
from torch import nn

from pcsr.contracts import Encoder, Widths
from pcsr.errors import UserError
from pcsr.network.build import build
from pcsr.network.outline import COMPUTED, LAYERS, LAYERS_PER_WEIGHT, bounded, outline
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import load

RECIPES = sorted((Path(__file__).parents[2] / "pcsr/recipes").glob("*.yaml"))
SINGLE = [path for path in RECIPES if "recipes:" not in path.read_text() and "weights:" not in path.read_text()]


def shapes(network):
    return {name: tensor.shape for name, tensor in network.state_dict().items()}


@pytest.mark.parametrize("path", SINGLE, ids=lambda path: path.stem)
def test_an_outline_is_that_of_the_network(path):
    registry = load_plugins()
    (recipe,) = load(path, registry)
    network = build(recipe, registry)
    state = torch.get_rng_state()
    planned = outline(recipe, registry, len(network.state_dict()))
    assert shapes(planned) == shapes(network)
    assert all(tensor.is_meta for tensor in (*planned.parameters(), *planned.buffers()))
    assert torch.equal(torch.get_rng_state(), state)
    assert torch.zeros(1).device.type == "cpu"


def with_encoder(part):
    registry = load_plugins()
    registry.entries["encoder", "mine"] = Entry("encoder", "mine", part, "tests", "1")
    (recipe,) = load(RECIPES[0].with_name("smoke.yaml"), registry, ["model.encoder=mine"])
    return recipe, registry


class Counting(Encoder):
    """Computes with a weight while it is built, which has no numbers on `meta`."""

    def __init__(self, widths: Widths) -> None:
        super().__init__()
        self.channels = 8
        self.layer = nn.Linear(3, 8)
        self.largest = float(self.layer.weight.max())


class Full(Encoder):
    """Keeps a large table that no file holds."""

    def __init__(self, widths: Widths) -> None:
        super().__init__()
        self.channels = 8
        self.register_buffer("table", torch.zeros(COMPUTED + 1), persistent=False)


def test_a_part_that_cannot_be_built_without_numbers_has_none():
    assert outline(*with_encoder(Counting), 100) is None


def test_large_buffers_are_refused():
    with pytest.raises(UserError, match=f"its buffers hold .* and {COMPUTED} is the most"):
        outline(*with_encoder(Full), 100)


def test_building_ends_where_there_are_too_many_layers():
    most = LAYERS + 3 * LAYERS_PER_WEIGHT
    with bounded(3):
        nn.ModuleList(nn.ReLU() for _ in range(most))
    with pytest.raises(UserError, match=f"more than {most} layers, and the file holds 3 weights"), bounded(3):
        nn.ModuleList(nn.ReLU() for _ in range(most + 1))
    nn.ModuleList(nn.ReLU() for _ in range(most + 1))


def test_other_threads_build_what_they_like():
    def much():
        made.append(nn.ModuleList(nn.ReLU() for _ in range(2 * LAYERS)))

    made = []
    with bounded(0):
        other = threading.Thread(target=much)
        other.start()
        other.join()
    assert len(made[0]) == 2 * LAYERS
