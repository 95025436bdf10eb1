"""`extends`, `--set` and `matrix`: what they make of the data, and where each piece of it stands then."""

import copy

import pytest

from pcsr.recipe import RecipeError
from pcsr.recipe.compose import compose
from pcsr.recipe.schema import DEFAULTS
from pcsr.recipe.source import Location


def test_extends_is_relative_to_its_file_and_goes_on(write):
    write("name: root\nseed: 1\ntrain: {epochs: 9, batch: 2}", "shared/root.yaml")
    write("extends: root.yaml\nname: middle\ntrain: {epochs: 5}", "shared/middle.yaml")
    (made,) = compose(write("extends: shared/middle.yaml\nname: leaf"))
    assert made.data == {"name": "leaf", "seed": 1, "train": {"epochs": 5, "batch": 2}}
    found = {
        keys: made.location(keys).origin.rpartition("/")[2] for keys in [("name",), ("seed",), ("train", "epochs")]
    }
    assert found == {("name",): "recipe.yaml", ("seed",): "root.yaml", ("train", "epochs"): "middle.yaml"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "name: a\nextends: nothing.yaml",
            r"recipe\.yaml:2:10: there is no recipe .*nothing\.yaml: extends is relative",
        ),
        (
            "extends: recipe.yaml",
            r"recipe\.yaml:1:10: 'recipe\.yaml' extends this recipe in turn: break the circle",
        ),
        ("extends: other.yaml", r"other\.yaml:1:10: 'recipe\.yaml' extends this recipe in turn"),
        ("extends: [a, b]", r"recipe\.yaml:1:10: extends must be one recipe file, got \['a', 'b'\]"),
    ],
)
def test_extends_that_leads_nowhere(write, text, said):
    write("extends: recipe.yaml", "other.yaml")
    with pytest.raises(RecipeError, match=said):
        list(compose(write(text)))


def test_set_reaches_into_a_part_by_its_bare_name(write):
    path = write("name: a\nmodel: {encoder: net, fusion: blend}")
    (made,) = compose(path, ["model.encoder.channels=4", "model.fusion={use: attention, heads: 2}", "seed=3"])
    assert made.data == {
        "name": "a",
        "seed": 3,
        "model": {"encoder": {"use": "net", "channels": 4}, "fusion": {"use": "attention", "heads": 2}},
    }
    assert made.location(("model", "encoder", "use")) == Location(str(path), 2, 18)
    assert made.location(("model",)) == Location(str(path), 2, 8)
    assert made.location(("model", "encoder", "channels")) == Location("--set model.encoder.channels=4")


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("train.epochs", "write --set dotted.key=value"),
        ("=3", "write --set dotted.key=value"),
        ("train..epochs=3", "write --set dotted.key=value"),
        ("train.epochs=[1", "expected ',' or ']'"),
        ("extends=other.yaml", "extends cannot be set by an option"),
    ],
)
def test_a_set_that_cannot_be_read_is_kept_as_a_mistake(write, override, said):
    (made,) = compose(write("name: a"), [override, "seed=2"])
    (mistake,) = made.mistakes
    assert mistake.location == Location(f"--set {override}")
    assert said in mistake.text
    assert made.data == {"name": "a", "seed": 2}


def test_a_bad_name_is_kept_as_it_is_written(write):
    (run,) = compose(write('name: "a\\n"\nmatrix: {seed: [1]}'))
    assert run.data["name"] == "a\n"


def test_a_recipe_without_a_model_gets_the_default_one_before_it_is_changed(write):
    path = write("name: a\nmatrix: {model.backbone.blocks: [2]}")
    (run,) = compose(path, ["model.encoder.channels=64"])
    expected = copy.deepcopy(DEFAULTS["model"])
    expected["encoder"]["channels"], expected["backbone"]["blocks"] = 64, 2
    assert run.data["model"] == expected != DEFAULTS["model"]
    (run,) = compose(write("name: a"), ["model={encoder: net}"])  # whoever writes a model names its parts
    assert run.data["model"] == {"encoder": {"use": "net"}}


@pytest.mark.parametrize("name", ["tapsr", "tapsr.yaml", "touch/size"])
def test_a_recipe_of_pcsr_is_named_from_anywhere(write, name):
    path = write(f"extends: {name}\nname: mine\n")
    (made, *_) = compose(path)
    assert "data" in made.data
    assert not made.mistakes


def test_a_file_beside_the_recipe_comes_before_the_recipe_of_pcsr(write):
    write("name: tapsr\nseed: 7\n", "tapsr.yaml")
    (made,) = compose(write("extends: tapsr.yaml\nname: mine\n"))
    assert made.data["seed"] == 7
