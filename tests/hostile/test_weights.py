"""Weights files of strangers: each is refused in one line before it costs time or memory."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from pcsr.network.build import build
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load

SMOKE = Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml"
SMALL = ["model.encoder.channels=8", "model.touch_encoder.channels=4", "model.backbone.channels=[8, 8]"]


@pytest.fixture(scope="module")
def upsample(limited, tmp_path_factory):
    """Upsamples a cloud with the weights `w.safetensors` of its folder."""
    folder = tmp_path_factory.mktemp("weights")
    np.savetxt(folder / "in.xyz", np.random.default_rng(0).normal(size=(60, 3)))

    def call():
        outcome = limited("upsample", "in.xyz", "-o", "out.xyz", "--model", "w.safetensors", folder=folder)
        assert (folder / "out.xyz").exists() == (outcome.code == 0)
        return outcome

    call.file = folder / "w.safetensors"
    return call


@pytest.fixture(scope="module")
def honest():
    """A network and its resolved recipe."""
    registry = load_plugins()
    (recipe,) = load(SMOKE, registry, SMALL)
    return build(recipe, registry), recipe.resolved()


def changed(plain, place, value):
    """The recipe with another value at one place."""
    plain = json.loads(json.dumps(plain))
    *keys, last = place.split(".")
    inner = plain
    for key in keys:
        inner = inner[key]
    inner[last] = value
    return plain


def write(path, header, length=None, data=b""):
    """A safetensors file of any header."""
    path.write_bytes((len(header) if length is None else length).to_bytes(8, "little") + header + data)


def write_card(path, card):
    """A file without weights whose card is any text."""
    write(path, json.dumps({"__metadata__": {"pcsr": card}}).encode())


def test_honest_weights_are_used(upsample, honest):
    network, plain = honest
    save_weights(upsample.file, network, {"recipe": plain})
    outcome = upsample()
    assert outcome.code == 0, outcome.err
    (upsample.file.parent / "out.xyz").unlink()


NETWORKS = {
    "wide": ("model.encoder.channels", 20_000, "encoder"),
    "very wide": ("model.backbone.channels", [20_000, 20_000], "backbone"),
    "wider than any memory": ("model.encoder.channels", 10**12, ""),
    "wider than any number": ("model.encoder.channels", 10**30, ""),
    "long": ("model.backbone.channels", [8] * 10**6, "at most 16 items"),
    "as large as its options allow": ("model.backbone.channels", [2048] * 16, "backbone"),
    "deep": ("model.backbone", {"use": "dense-edge-conv", "layers": 10**6}, "layers"),
    "with large buffers": ("model.upsampler", {"use": "up-down-up", "surplus": 10**9}, ""),
}


@pytest.mark.parametrize("kind", NETWORKS)
def test_a_network_that_is_not_that_of_the_file_is_not_built(upsample, honest, kind):
    place, value, word = NETWORKS[kind]
    network, plain = honest
    save_weights(upsample.file, network, {"recipe": changed(plain, place, value)})
    outcome = upsample()
    outcome.refused("w.safetensors", word, "train again")
    assert len(outcome.err) < 1000


@pytest.mark.parametrize(
    ("card", "word"),
    [
        ("[" * 100_000, "nested more than 50 deep"),
        ('{"a":' * 100 + "1" + "}" * 100, "nested more than 50 deep"),
        ('{"recipe": NaN}', "NaN, which is no number"),
        ('{"recipe": {"seed": -Infinity}}', "-Infinity, which is no number"),
        ('{"recipe": "\\ud800"}', "surrogates"),
        ('{"recipe": ' + "1" * 10_000 + "}", "digits"),
        (json.dumps({"recipe": "x" * 5_000_000}), "4000000 are the most"),
        ("", "not a weights file"),
        ("3", "its card is a int"),
        ('{"recipe": 3}', "holds no recipe"),
        ('{"recipe": {"model": {"encoder": {"use": "\\u001b[2J\\n"}}}}', r"need encoder '\x1b[2J\n', which no plugin"),
        (json.dumps({"recipe": {"model": {"encoder": {"use": "x" * 3_000_000}}}}), "need encoder 'xxx"),
        ('{"recipe": {"name": "x", "model": {"encoder": {"use": ["unet"]}}}}', "cannot be built here"),
    ],
)
def test_a_card_of_nonsense_is_refused(upsample, card, word):
    write_card(upsample.file, card)
    outcome = upsample()
    outcome.refused("w.safetensors", word)
    assert len(outcome.err) < 1000


def test_a_header_of_a_hundred_megabytes_is_not_read(upsample):
    with upsample.file.open("wb") as file:
        file.write((100_000_000 - 8).to_bytes(8, "little") + b'{"a":')
        file.truncate(100_000_100)
    upsample().refused("its header has 99999992 bytes")


def test_a_header_longer_than_its_file_is_refused(upsample):
    write(upsample.file, b"{}", length=2**63)
    upsample().refused("not a weights file")


def test_a_hundred_thousand_empty_weights_are_no_network(upsample, honest):
    card = json.dumps({"recipe": honest[1]})
    empty = {f"{n}": {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]} for n in range(100_000)}
    write(upsample.file, json.dumps({"__metadata__": {"pcsr": card}, **empty}).encode())
    upsample().refused("do not fit", "the file has no")


def test_weights_that_are_not_finite_are_refused(upsample, honest):
    network, plain = honest
    state = {name: torch.full_like(tensor, torch.inf) for name, tensor in network.state_dict().items()}
    damaged = build(load(SMOKE, load_plugins(), SMALL)[0], load_plugins())
    damaged.load_state_dict(state)
    save_weights(upsample.file, damaged, {"recipe": plain})
    upsample().refused("not all finite")
