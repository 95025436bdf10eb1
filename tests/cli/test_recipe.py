"""`pcsr recipe`: check, show, schema; and the recipes that come with the project."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from ruamel.yaml import YAML

from pcsr.cli import pcsr
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import from_resolved, load

RECIPES = sorted((Path(__file__).parents[2] / "pcsr/recipes").glob("*.yaml"))


def invoke(*arguments):
    return CliRunner().invoke(pcsr, ["recipe", *map(str, arguments)])


@pytest.fixture(scope="module")
def registry():
    return load_plugins()


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_our_recipes_have_no_mistake(path, registry):
    recipes = load(path, registry)
    assert recipes[0].name.startswith(path.stem)
    assert len({recipe.name for recipe in recipes}) == len(recipes)


@pytest.mark.slow
def test_table_4_is_the_papers_three_networks_and_others_each_with_zero_to_five_touches(registry):
    (path,) = [path for path in RECIPES if path.stem == "table4"]
    every = load(path, registry)
    untouched = [r for r in every if r.touch_range == (0, 0)]
    assert [(r.model.encoder.use, r.data.touches, r.seed) for r in untouched] == [
        (encoder, 0, seed) for encoder in ("mlp", "unet") for seed in range(3)
    ], "PU-Transformer alone, and the control with all blocks"
    runs = [r for r in every if r not in untouched]
    rows = {(r.model.encoder.use, r.model.fusion.use) for r in runs}
    assert rows > {("mlp", "none"), ("unet", "concat"), ("unet", "iterative")}
    values = {(r.model.encoder.use, r.model.fusion.use, r.data.touches, r.seed) for r in runs}
    assert values == {(*row, touches, seed) for row in rows for touches in range(6) for seed in range(3)}
    assert {(r.touch_range, r.data_seed) for r in runs} == {((0, 5), 0)}, "one network serves every number of touches"
    assert len({r.fingerprint for r in runs}) == 3 * len(rows)


def test_check_goes_through_all_files_and_prints_all_mistakes(tmp_path):
    good, bad, gone = (tmp_path / f"{name}.yaml" for name in ("good", "bad", "gone"))
    good.write_text("name: good")
    bad.write_text("name: bad\nseed: x\ntrain: {epoch: 1}")
    result = invoke("check", bad, gone, good)
    assert result.exit_code == 2
    assert result.stdout == f"{good}: good\n"
    assert result.stderr.splitlines() == [
        f"{bad}:2:7: seed: it must be a whole number, got 'x'",
        f"{bad}:3:9: train takes no 'epoch': did you mean 'epochs'?",
        f"recipe {gone} cannot be read: No such file or directory",
    ]
    result = invoke("check", good, "--set", "matrix={seed: [1, 2]}")
    assert (result.exit_code, result.stdout) == (0, f"{good}: good, 2 runs:\n    1 good-seed.1\n    2 good-seed.2\n")


def test_show_prints_a_recipe_that_means_the_same(tmp_path, registry):
    path = tmp_path / "r.yaml"
    path.write_text("name: r\ntrain: {learning_rate: 1e-5}")
    result = invoke("show", path, "--set", "train.epochs=7")
    assert result.exit_code == 0
    (expected,) = load(path, registry, ["train.epochs=7"])
    assert from_resolved(YAML(typ="safe", pure=True).load(result.stdout), registry) == expected
    shown = tmp_path / "shown.yaml"
    shown.write_text(result.stdout)
    assert load(shown, registry) == [expected]


def test_show_prints_each_run_of_a_matrix(tmp_path):
    path = tmp_path / "r.yaml"
    path.write_text("name: r\nmatrix: {seed: [1, 2]}")
    documents = list(YAML(typ="safe", pure=True).load_all(invoke("show", path).stdout))
    assert [(one["name"], one["seed"]) for one in documents] == [("r-seed.1", 1), ("r-seed.2", 2)]


def test_show_prints_mistakes_as_they_are_and_nothing_else(tmp_path):
    path = tmp_path / "r.yaml"
    path.write_text("name: r\nseed: -1\nmodel: {fusion: 1}")
    result = invoke("show", path)
    assert (result.exit_code, result.stdout) == (2, "")
    assert all(line.startswith(f"{path}:") for line in result.stderr.splitlines())


PLUGIN = """
from pcsr import Fusion, hookimpl

class Mine(Fusion):
    def __init__(self, widths, *, heads: int = 4) -> None:
        super().__init__()

@hookimpl
def pcsr_register(register):
    register.fusion("mine", Mine)
"""


def test_a_plugin_file_brings_parts_to_recipes(tmp_path):
    path, plugin = tmp_path / "r.yaml", tmp_path / "mine.py"
    path.write_text("extends: base.yaml\nmodel: {fusion: {use: mine, heads: 2}}")
    (tmp_path / "base.yaml").write_text(
        "name: r\nmodel: {encoder: unet, fusion: none, backbone: pu-transformer, upsampler: shuffle}"
    )
    plugin.write_text(PLUGIN)
    assert "there is no fusion 'mine'" in invoke("check", path).stderr
    assert invoke("check", path, "--plugin", plugin).exit_code == 0
    schema = json.loads(invoke("schema", "--plugin", plugin).stdout)
    assert "mine" in schema["$defs"]["fusion-part"]["anyOf"][0]["enum"]
    missing = invoke("check", path, "--plugin", tmp_path / "nothing.py")
    assert (missing.exit_code, missing.stderr) == (
        2,
        f"pcsr: error: --plugin {tmp_path / 'nothing.py'}: there is no such file\n",
    )
