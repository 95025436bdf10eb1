"""docs/recipes.md: its recipes are good, its table of defaults is true, its mistakes look like that."""

import re
import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from pcsr.plugins.loading import load_plugins
from pcsr.recipe import RecipeError, load

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
KEYS = re.search(r"^## The sections\n.*?(?=^## )", TEXT, re.MULTILINE | re.DOTALL)[0]
ROWS = re.findall(r"^\| `([a-z_.]+)` \| (\S.*?) \|", KEYS, re.MULTILINE)


@pytest.fixture(scope="module")
def plugins():
    return load_plugins()


def named(value):
    """A part by its name, as the table has it."""
    if isinstance(value, list):
        return [named(one) for one in value]
    return value.get("use", value) if isinstance(value, dict) else value


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: re.search("name: (\\S+)", block)[1])
def test_each_recipe_is_good(block, plugins, tmp_path):
    shutil.copytree(ROOT / "pcsr/recipes", tmp_path, dirs_exist_ok=True)
    path = tmp_path / "documented.yaml"
    path.write_text(block, encoding="utf-8")
    names = [recipe.name for recipe in load(path, plugins)]
    if "matrix" in block:
        number = {2: "two", 6: "six"}[len(names)]
        assert f"That is {number} runs, from `{names[0]}` to `{names[-1]}`" in " ".join(TEXT.split())


def test_each_default_is_true_and_none_is_left_out(registry, write):
    (recipe,) = load(write("name: a", model=True), registry)
    plain = recipe.resolved()
    for section in ("data", "train", "evaluate"):
        plain |= {f"{section}.{key}": value for key, value in plain.pop(section).items()}
    plain |= {f"data.view.{key}": value for key, value in plain.pop("data.view").items()}
    plain["model.touch_encoder"] = plain.pop("model")["touch_encoder"]
    documented = dict(ROWS)
    assert documented.keys() == plain.keys()
    for key, text in documented.items():
        value = named(plain[key])
        if key not in ("name", "train.augment"):
            assert YAML(typ="safe", pure=True).load(text.strip("`")) == value, key


def test_the_mistakes_look_like_that(plugins, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = Path("mine.yaml")
    path.write_text(
        "name: mine\ndata:\n  touches: many\nmodel:\n"
        "  encoder: {use: unet, order: file, chanels: 3}\n  fusion: iterativ\n"
        "  backbone: pu-transformer\n  upsampler: shuffle\nevaluate:\n  metrics: [cd, chamfer]\n"
    )
    with pytest.raises(RecipeError) as caught:
        load(path, plugins)
    assert re.search(r"\$ pcsr recipe check mine\.yaml\n(.*?)\n```", TEXT, re.DOTALL)[1] == str(caught.value)
