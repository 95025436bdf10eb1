"""The recipes that come with pcsr: found by name, each name once, and one TAPSR."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.recipe.source import read
from pcsr.recipes import HERE, found, names

REGISTRY = load_plugins()


def test_no_two_recipes_have_one_name():
    own = [read(found(Path(name))).data["name"] for name in names()]
    assert len(own) == len(set(own)) > 30


def test_a_recipe_without_a_model_gets_that_of_tapsr(tmp_path):
    (tmp_path / "mine.yaml").write_text("name: mine\n")
    (mine,), (tapsr,) = load(tmp_path / "mine.yaml", REGISTRY), load(Path("tapsr"), REGISTRY)
    assert mine.model == tapsr.model


@pytest.mark.parametrize("path", ["touch/size", "recipes/touch/size.yaml", "touch/size.yaml"])
def test_a_name_finds_the_file_from_anywhere(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "touch").mkdir()
    assert found(Path(path)) == HERE / "touch" / "size.yaml"


def test_a_file_of_ones_own_wins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tapsr.yaml").write_text("name: mine\n")
    assert found(Path("tapsr.yaml")) == Path("tapsr.yaml")
    assert found(Path("tapsr")) == HERE / "tapsr.yaml"


def test_a_misspelt_name_is_told_the_right_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=r"there is no recipe 'taspr', neither .*: did you mean 'tapsr'\?"):
        load(Path("taspr"), REGISTRY)
    with pytest.raises(UserError, match=r"recipe taspr\.yaml cannot be read: No such file"):
        load(Path("taspr.yaml"), REGISTRY)


def test_commands_take_names():
    done = CliRunner().invoke(pcsr, ["recipe", "show", "tapsr", "--set", "seed=3"])
    assert done.exit_code == 0, done.output
    assert "name: tapsr\nseed: 3" in done.output
    done = CliRunner().invoke(pcsr, ["recipe", "check", "table2", "touch/size"])
    lines = done.output.splitlines()
    assert [line for line in lines if ": good" in line] == ["table2: good, 25 runs:", "touch/size: good, 24 runs:"]
    assert len(lines) == 2 + 25 + 24
