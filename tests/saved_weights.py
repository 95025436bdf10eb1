"""Weights of a small network in a file, and what is said about a file that is refused."""

import functools
from pathlib import Path

import pytest

from pcsr.errors import UserError
from pcsr.network.build import build
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe, load

SMOKE = Path(__file__).parents[1] / "pcsr/recipes/smoke.yaml"
plugins = functools.cache(load_plugins)


def recipe(*overrides: str) -> Recipe:
    small = ["model.encoder.channels=16", "model.backbone.channels=[8, 16]"]
    small.append("model.upsampler={use: shuffle, hidden: 16, start: neighbours}")
    (only,) = load(SMOKE, load_plugins(), [*small, *overrides])
    return only


def save(folder: Path) -> tuple[Path, Network]:
    network = build(recipe(), load_plugins())
    path = folder / "weights.safetensors"
    save_weights(path, network, {"recipe": recipe().resolved(), "metrics": {"cd": 0.125}})
    return path, network


def refusal(path, registry=None):
    """Return the message by which weights are refused: one line that names the file."""
    with pytest.raises(UserError) as caught:
        load_weights(path, registry or plugins())
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    return str(caught.value)
