"""Weights with parts of others: they are noted, asked for where they are missing, and named where they do not fit."""

import dataclasses
import re

import pytest

from pcsr import __version__
from pcsr.network.build import build
from pcsr.network.card import foreign_parts
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Failure
from tests.saved_weights import recipe, refusal, save


@pytest.fixture
def saved(tmp_path):
    return save(tmp_path)


def brought(owner, version, kind="fusion", name=None, registry=None):
    """A registry whose part is somebody else's."""
    registry = registry or load_plugins()
    key = kind, name or getattr(recipe().model, kind).use
    registry.entries[key] = dataclasses.replace(registry.entries[key], owner=owner, version=version)
    return registry


def test_parts_of_others_are_noted_each_once_and_ours_are_not():
    plain = recipe().resolved()
    assert foreign_parts(plain, load_plugins()) == []
    fusion, encoder = recipe().model.fusion.use, recipe().model.encoder.use
    registry = brought("/home/me/mine.py", "file", "encoder", registry=brought("pcsr-attention", "0.2"))
    assert foreign_parts(plain, registry) == [
        {"kind": "encoder", "name": encoder, "owner": "mine.py", "version": "file"},
        {"kind": "fusion", "name": fusion, "owner": "pcsr-attention", "version": "0.2"},
    ]


@pytest.fixture
def foreign(tmp_path):
    """Weights whose fusion came with another distribution."""
    path, registry = tmp_path / "foreign.safetensors", brought("pcsr-attention", "0.2")
    save_weights(path, build(recipe(), registry), {"recipe": recipe().resolved(), "version": __version__}, registry)
    return path, registry, recipe().model.fusion.use


def test_weights_with_parts_of_others_load_where_those_are(foreign):
    path, registry, fusion = foreign
    card = load_weights(path, registry)[2]
    assert card["parts"] == [{"kind": "fusion", "name": fusion, "owner": "pcsr-attention", "version": "0.2"}]


def test_a_missing_part_is_named_with_what_brings_it(foreign):
    path, registry, fusion = foreign
    del registry.entries["fusion", fusion]
    assert refusal(path, registry) == (
        f"the weights {path} need fusion '{fusion}' of pcsr-attention 0.2: pip install pcsr-attention==0.2"
    )
    brought("pcsr-attention", "0.3", name="none", registry=registry)
    assert "0.2, and pcsr-attention 0.3 is installed: pip install pcsr-attention==0.2" in refusal(path, registry)
    registry.failures.append(Failure("pcsr-attention", "0.2", ImportError("no")))
    assert "which failed to load: see `pcsr plugins --why pcsr-attention`" in refusal(path, registry)


def test_a_missing_plugin_file_is_asked_for(tmp_path):
    path, registry = tmp_path / "w.safetensors", brought("/home/me/mine.py", "file")
    save_weights(path, build(recipe(), registry), {"recipe": recipe().resolved()}, registry)
    del registry.entries["fusion", recipe().model.fusion.use]
    assert re.search(r"of the plugin file mine\.py: hand in that file with --plugin", refusal(path, registry))


@pytest.mark.parametrize("parts", [None, 3, [3], [{"kind": "fusion"}], "evil"])
def test_a_missing_part_of_which_nothing_can_be_believed_is_named_alone(saved, parts):
    path, network = saved
    fusion, registry = recipe().model.fusion.use, load_plugins()
    if parts == "evil":
        parts = [{"kind": "fusion", "name": fusion, "owner": "x; rm -r .", "version": "1\n2"}]
    save_weights(path, network, {"recipe": recipe().resolved(), "parts": parts})
    del registry.entries["fusion", fusion]
    assert f"need fusion '{fusion}', which no plugin here brings" in refusal(path, registry)


def test_where_weights_do_not_fit_both_versions_are_named(foreign):
    path, registry, fusion = foreign
    network, wider = build(recipe(), registry), recipe("model.upsampler.hidden=24").resolved()
    save_weights(path, network, {"recipe": wider, "version": __version__}, registry)
    assert "They may come from another version of its parts" in refusal(path, registry), "the versions are the same"
    newer = brought("pcsr-attention", "0.3")
    assert refusal(path, newer).endswith(
        f"They were made by fusion '{fusion}' of pcsr-attention 0.2, this is pcsr-attention 0.3: "
        f"pip install pcsr-attention==0.2, or train again"
    )
    save_weights(path, network, {"recipe": wider, "version": "0.0.9"})
    assert refusal(path, newer).endswith(
        f"They were made by pcsr 0.0.9, this is {__version__}: pip install pcsr==0.0.9, or train again"
    )
    save_weights(path, network, {"recipe": wider, "version": "0.0.9"}, brought("/home/me/mine.py", "file"))
    assert refusal(path, registry).endswith(
        f"by fusion '{fusion}' of mine.py file and pcsr 0.0.9, this is pcsr-attention 0.2 and pcsr {__version__}: "
        f"pip install pcsr==0.0.9, hand in mine.py with --plugin, or train again"
    )


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("model", "upsampler", "colour"), "red", "takes no 'colour'"),
        (("model", "encoder", "channels"), -1, "cannot be built here"),
        (("model", "encoder", "channels"), 10**12, "cannot be built here"),
        (("model",), 3, "cannot be built here"),
        (("data",), None, "cannot be built here"),
        (("model", "fusion"), [], "cannot be built here"),
    ],
)
def test_a_recipe_that_cannot_be_built_is_refused_with_the_version_that_made_it(saved, keys, value, said):
    path, network = saved
    plain = recipe().resolved()
    inner = plain
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    save_weights(path, network, {"recipe": plain, "version": "0.0.9"})
    message = refusal(path)
    assert said in message
    assert f"made by pcsr 0.0.9, this is {__version__}" in message
