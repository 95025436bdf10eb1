"""Grafts in recipes: their file, weights, defaults, merging, fingerprints and mistakes."""

import shutil

import pytest
from safetensors.torch import save_file

from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import from_resolved, load
from pcsr.recipe.schema import GraftedModel
from pcsr.recipe.source import RecipeError
from tests.foreign_networks import FOLDER, network

GRAFT = """\
name: mine
data: {points: 64, rate: 4, touches: 2}
model:
  graft:
    network: cascade.py:Cascade
    at: first.features
"""


@pytest.fixture
def write(tmp_path):
    """Write a recipe beside the networks; the lines follow those of the graft."""
    for file in FOLDER.glob("*.py"):
        shutil.copy(file, tmp_path)

    def written(more="", graft=GRAFT, name="mine.yaml"):
        (tmp_path / name).write_text(graft + more)
        return tmp_path / name

    return written


def read(path, *overrides, registry=None, axes=None):
    return load(path, load_plugins() if registry is None else registry, overrides, axes)


def test_a_graft_has_defaults_and_the_name_of_its_file_alone(write):
    registry = load_plugins()
    (recipe,) = read(write(), registry=registry)
    assert isinstance(recipe.model, GraftedModel)
    plain = recipe.resolved()["model"]["graft"]
    assert plain["network"] == "cascade.py:Cascade"
    options = {"pool": "none", "pairing": "hilbert", "offsets": False, "negative_slope": 0.0}
    assert plain["fusion"] == {"use": "iterative", **options}
    assert plain["touch_encoder"]["channels"] == 32
    assert not recipe.model.graft.is_frozen
    assert len(recipe.code["model.graft.network"]) == 12
    assert [path.name for path in registry.files] == ["cascade.py"]
    assert from_resolved(recipe.resolved(), registry) == recipe
    with pytest.raises(
        RecipeError, match=r"model\.graft\.network: the network 'Cascade' of the file cascade\.py: hand in"
    ):
        from_resolved(recipe.resolved(), load_plugins())


def test_a_file_is_relative_to_the_recipe_and_in_an_option_to_the_working_directory(write, tmp_path, monkeypatch):
    path = write()
    monkeypatch.chdir(tmp_path.parent)
    (one,) = read(path)
    monkeypatch.chdir(tmp_path)
    (two,) = read(path, "model.graft.network=./cascade.py:Cascade")
    assert one.fingerprint == two.fingerprint


def test_a_file_that_was_handed_in_need_not_lie_beside_the_recipe(write, tmp_path):
    path = write(name="mine.yaml")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    shutil.move(path, elsewhere / "mine.yaml")
    with pytest.raises(RecipeError, match=r"mine\.yaml:5:14: model\.graft\.network: there is no file .*cascade\.py"):
        read(elsewhere / "mine.yaml")
    read(elsewhere / "mine.yaml", registry=load_plugins([tmp_path / "cascade.py"]))


def test_an_edit_of_the_network_changes_the_fingerprint_but_not_that_of_the_settings(write, tmp_path):
    path = write()
    (before,) = read(path)
    with (tmp_path / "cascade.py").open("a") as file:
        file.write("\n# edited\n")
    (after,) = read(path)
    assert before.fingerprint != after.fingerprint
    assert before.settings_fingerprint == after.settings_fingerprint


def test_parts_of_the_graft_are_compared_like_those_of_a_network(write):
    recipes = read(write(), axes={"model.fusion": ["concat", "iterative"]})
    assert [one.name for one in recipes] == ["mine-fusion.concat", "mine-fusion.iterative"]
    assert [one.model.graft.fusion.use for one in recipes] == ["concat", "iterative"]
    (one,) = read(write("    fusion: concat\n    touch_encoder: null\n"))
    assert (one.model.graft.fusion.use, one.model.graft.touch_encoder) == ("concat", None)
    (one,) = read(write(), "model.graft.touch_encoder.channels=8")
    assert one.model.graft.touch_encoder.options["channels"] == 8


def test_a_graft_replaces_the_model_that_a_recipe_inherits(write):
    (one,) = read(write("extends: smoke\n"))
    assert isinstance(one.model, GraftedModel)
    write("    options: {channels: 16}\n", name="parent.yaml")
    other = "extends: parent.yaml\nname: other\nmodel: {graft: {network: kernel_upsampler.py:network, at: encoder}}\n"
    (one,) = read(write(graft=other))
    assert one.model.graft.options == {}, "options are those of the other network"
    (one,) = read(write(graft="extends: parent.yaml\nname: other\nmodel: {graft: {at: second.features}}\n"))
    assert one.model.graft.options == {"channels": 16}


def test_weights_are_named_by_their_hash_and_freeze_the_network(write, tmp_path):
    save_file(network("cascade").state_dict(), tmp_path / "theirs.safetensors")
    (one,) = read(write("    weights: theirs.safetensors\n"))
    assert one.model.graft.is_frozen
    assert one.model.graft.weights.use == str(tmp_path / "theirs.safetensors")
    (same,) = read(write(f"    weights: {{use: theirs.safetensors, sha256: {one.model.graft.weights.sha256}}}\n"))
    assert one.fingerprint == same.fingerprint
    (tmp_path / "theirs.safetensors").rename(tmp_path / "renamed.safetensors")
    (moved,) = read(write("    weights: renamed.safetensors\n"))
    assert one.fingerprint == moved.fingerprint
    (thawed,) = read(write("    weights: renamed.safetensors\n    frozen: false\n"))
    assert thawed.fingerprint != moved.fingerprint


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("    fusion: iterativ\n", r"7:13: there is no fusion 'iterativ': did you mean 'iterative'\?"),
        ("    fusion: {use: concat, touch: 1}\n", r"7:27: fusion 'concat' takes no 'touch': did you mean 'touches'\?"),
        ("    netwrk: x\n", r"7:5: model graft takes no 'netwrk': did you mean 'network'\?"),
        ("  encoder: unet\n", r"7:3: a model has either graft or encoder: remove one"),
        ("    options: {chanels: 3}\n", r"7:14: .*Cascade cannot be called with \{'chanels': 3\}: got an unexpected"),
        ("    points: 1\n", r"7:13: model\.graft\.points is 1, and there are 0 other arguments"),
        ("    layout: cnb\n", r"7:13: model\.graft\.layout: it must be"),
        ("    weights: none.pth\n", r"7:14: model\.graft\.weights: there is no file .*none\.pth"),
        ("    frozen: true\ntrain: {touches: 0}\n", r"7:13: model\.graft\.frozen: the network is not trained"),
    ],
)
def test_mistakes_have_their_line(write, more, message):
    with pytest.raises(RecipeError, match=message) as caught:
        read(write(more))
    assert len(caught.value.mistakes) == 1


@pytest.mark.parametrize(
    ("network", "message"),
    [
        ("cascade.py:Cascad", r"5:14: .*cascade\.py has no network 'Cascad': did you mean 'Cascade'\?"),
        ("none.py:Cascade", r"5:14: model\.graft\.network: there is no file .*none\.py"),
        ("cascade.py", r"5:14: model\.graft\.network must be FILE:CLASS, such as network\.py:Net, got 'cascade\.py'"),
        ("os:system", r"5:14: model\.graft\.network must be FILE:CLASS"),
        (
            "broken.py:Net",
            r"5:14: .*broken\.py cannot be loaded: ModuleNotFoundError: No module named 'pointops_of_cuda'",
        ),
    ],
)
def test_a_network_that_cannot_be_found_is_one_mistake(write, tmp_path, network, message):
    (tmp_path / "broken.py").write_text("import pointops_of_cuda\n")
    with pytest.raises(RecipeError, match=message) as caught:
        read(write(graft=GRAFT.replace("cascade.py:Cascade", network)))
    assert len(caught.value.mistakes) == 1


def test_a_graft_without_a_layer_or_a_network_is_incomplete(write):
    with pytest.raises(RecipeError, match=r"4:5: model\.graft\.network is missing: add it") as caught:
        read(write(graft="name: mine\nmodel:\n  graft:\n    {}\n".replace("    {}", "    frozen: false")))
    assert "model.graft.at is missing: add it" in str(caught.value)
    with pytest.raises(RecipeError, match=r"model\.graft is a section"):
        read(write(graft="name: mine\nmodel: {graft: 7}\n"))


def test_no_code_of_a_card_is_run(write, tmp_path):
    """The path in a recipe that was resolved, as in weights, is that of no file."""
    (recipe,) = read(write())
    marker = tmp_path / "ran"
    (tmp_path / "evil.py").write_text(f"from pathlib import Path\nPath({str(marker)!r}).touch()\nNet = dict\n")
    for name in ("evil.py:Net", str(tmp_path / "evil.py:Net"), "../evil.py:Net"):
        plain = recipe.resolved()
        plain["model"]["graft"]["network"] = name
        with pytest.raises(UserError):
            from_resolved(plain, load_plugins())
    assert not marker.exists()
