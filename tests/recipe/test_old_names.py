"""Recipes and cards that pcsr 0.1 wrote: read with one warning, and the same to every hash."""

import json
import warnings
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from pcsr.errors import PcsrWarning
from pcsr.files import sha256
from pcsr.network.load import load_weights
from pcsr.plugins import renamed
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import check_card, load
from pcsr.recipe.old_names import KEYS, OPTIONS, as_in_0_1, modern_key
from pcsr.recipe.source import RecipeError
from pcsr.weights import SHA256_IN_0_1, names, shipped
from pcsr_plugins.touch.digit import Digit

OLD = Path(__file__).parents[1] / "version_0_1"
FINGERPRINTS = {
    "0.001": "a5744904dcb1314e1d3f17f896a3635aa01bc9e4d6199d3c07fd65d930b03602",
    "0.002": "415afe9a6f7ea082f8f814951e1d5f054e005d167964588d1d31e2840c1ef6e8",
}
"""What 0.1 gave the two runs of `version_0_1/recipe.yaml`, by their learning rate."""


@pytest.fixture(scope="module")
def registry():
    return load_plugins()


def test_a_recipe_of_0_1_is_read_under_the_new_names_with_one_warning(monkeypatch):
    monkeypatch.setattr(Digit, "version", 1)  # as it was in 0.1
    with pytest.warns(PcsrWarning) as caught:
        runs = list(load(OLD / "recipe.yaml", load_plugins()))
    (text,) = {str(warning.message) for warning in caught}
    assert text.startswith(f"{OLD / 'recipe.yaml'} uses names of pcsr 0.1")
    for old, new in (*renamed.PARTS.items(), *KEYS.items()):
        if old != ("fusion", "inserted"):
            assert f"{old[1]} is now" in text.replace("'", "").replace(f"{old[0]}.", ""), old
            assert new in text
    assert "option 'heard' of fusion 'edge-conv' is now 'points_per_touch'" in text
    first = runs[0]
    assert first.evaluate.baselines == ("midpoint", "floor")
    assert first.patches.overlap == 2
    assert first.model.fusion.options["points_per_touch"] == 32
    assert {str(run.train.learning_rate): run.fingerprint for run in runs} == FINGERPRINTS


def test_recipes_of_today_warn_of_nothing_and_say_it_with_new_names(registry, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        (old, _) = load(OLD / "recipe.yaml", registry)
    path = tmp_path / "new.yaml"
    path.write_text(json.dumps(old.resolved()))
    (new,) = load(path, registry)
    assert new == old


@pytest.mark.parametrize("name", ["frames", "tapsr"])
def test_a_card_of_0_1_means_the_network_that_it_meant(name, registry):
    card = json.loads((OLD / f"card-{name}.json").read_text())
    with pytest.warns(PcsrWarning, match="the card uses names of pcsr 0.1") as caught:
        recipe = check_card(card["recipe"], registry, "the card")
    assert len(caught) == 1
    assert recipe.fingerprint == card["fingerprint"]
    written = as_in_0_1(recipe.resolved())
    assert written["model"] == card["recipe"]["model"]
    assert written["data"] == card["recipe"]["data"]
    assert written["train"] == card["recipe"]["train"]


@pytest.mark.parametrize("override", ["train.rate=0.5", "train={rate: 0.5}"])
def test_an_old_key_on_the_command_line(override, registry):
    with pytest.warns(PcsrWarning, match=r"train\.rate is now train\.learning_rate"):
        (recipe,) = load(Path("smoke"), registry, [override])
    assert recipe.train.learning_rate == 0.5


def test_an_old_key_beside_the_new_one_is_a_mistake(registry, tmp_path):
    path = tmp_path / "both.yaml"
    path.write_text("name: both\ntrain: {rate: 1e-3, learning_rate: 1e-3}")
    with pytest.raises(
        RecipeError,
        match=r"both\.yaml:2:9: train\.rate is the old name of train\.learning_rate, which is given too: remove it",
    ):
        list(load(path, registry))


def test_a_mistake_in_an_old_key_is_reported_where_it_stands(registry, tmp_path):
    path = tmp_path / "wrong.yaml"
    path.write_text("name: wrong\ntrain:\n  rate: fast\n")
    with pytest.warns(PcsrWarning), pytest.raises(RecipeError, match=r"wrong\.yaml:3:9: train\.learning_rate: "):
        list(load(path, registry))


def test_keys_of_today_stay():
    assert [modern_key(key) for key in ("train.rate", "data.rate", "seed")] == [
        "train.learning_rate",
        "data.rate",
        "seed",
    ]


def test_each_renamed_part_and_option_is_there(registry):
    for (kind, old), new in renamed.PARTS.items():
        assert (kind, old) not in registry.entries
        assert (kind, new) in registry.entries
    assert all((kind, name) in registry.entries for kind, name in OPTIONS)


@pytest.mark.parametrize("name", ["frames", "tapsr"])
def test_a_weights_file_of_0_1_gives_the_same_network(name, registry, tmp_path):
    card = json.loads((OLD / f"card-{name}.json").read_text())
    path = tmp_path / "old.safetensors"
    save_file(load_file(shipped(name)), path, {"pcsr": json.dumps(card)})
    with pytest.warns(PcsrWarning, match=r"uses names of pcsr 0\.1") as caught:
        network, recipe, _ = load_weights(path, registry)
    assert len(caught) == 1
    assert recipe.fingerprint == card["fingerprint"]
    today = load_weights(shipped(name), registry)[0]
    points = torch.rand(1, 64, 3, generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        assert torch.equal(network(points, 4 if name == "frames" else 16), today(points, 4 if name == "frames" else 16))


CHILDREN = {
    "a child": ("data: {touch: {depth_noise: 0.1}}", ()),
    "a matrix": ("matrix: {data.touch.depth_noise: [0.1]}", ()),
    "an option": ("", ["data.touch.depth_noise=0.1"]),
}


@pytest.mark.parametrize("child", CHILDREN)
def test_an_old_option_over_the_part_of_a_parent(child, registry, tmp_path):
    text, overrides = CHILDREN[child]
    (tmp_path / "parent.yaml").write_text("name: parent\ndata: {touch: {use: digit, depth_noise: 0.05, blur: 0.2}}")
    (tmp_path / "child.yaml").write_text(f"extends: parent.yaml\nname: child\n{text}")
    with pytest.warns(PcsrWarning, match="depth_noise"):
        (recipe,) = load(tmp_path / "child.yaml", registry, overrides)
    noise = recipe.data.touch.options["noise"]
    assert (noise.depth_noise, noise.blur) == (0.1, 0.2)


def test_another_policy_keeps_the_options_beside_it(registry, tmp_path):
    path = tmp_path / "policies.yaml"
    path.write_text(
        "name: policies\ndata: {touch: {use: digit, policy: {use: grasp, spacing: 30, tries: 500}}}\n"
        "matrix: {data.touch.policy: [uniform, grasp]}"
    )
    policies = [recipe.data.touch.options["policy"] for recipe in load(path, registry)]
    assert [(one.use, one.spacing, one.tries) for one in policies] == [("uniform", 30, 500), ("grasp", 30, 500)]


def test_an_old_key_on_the_command_line_wins_over_an_old_matrix(registry):
    with pytest.warns(PcsrWarning):
        (recipe,) = load(OLD / "recipe.yaml", registry, ["train.rate=0.5"])
    assert recipe.train.learning_rate == 0.5


def test_shipped_weights_count_as_those_of_0_1(registry, tmp_path):
    assert {sha256(shipped(name)) for name in names() if name != "field"} == set(SHA256_IN_0_1), "field is of 0.3"
    path = tmp_path / "weights.yaml"
    written = "a48aff982cb3c3c4929fdff8dfb8fc08ced219945f87b808b32c0f48102fd98d"  # as in a run folder of 0.1
    path.write_text(f"name: finished\nweights: {{use: frames, sha256: {written}}}")
    (recipe,) = load(path, registry)
    assert recipe.weights.sha256 == sha256(shipped("frames"))
