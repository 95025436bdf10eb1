"""A run folder holds what repeats its run."""

import json
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.experiments.environment import commit, environment, plugin_files, record
from pcsr.plugins.code import file_code
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.results import read_results
from pcsr.run_files import read_environment

SMOKE = Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml"
PLUGIN = """
import sys
from pathlib import Path
sys.path.insert(0, str(Path(__file__).parent))
import pcsr_test_beside
from pcsr import Fusion, hookimpl

class Mine(Fusion):
    def __init__(self, widths):
        super().__init__()
        self.layer = pcsr_test_beside.Linear(widths.touch, widths.visual)

    def forward(self, points, features, touches):
        return features + self.layer(touches.flat.mean(1, keepdim=True))

@hookimpl
def pcsr_register(register):
    register.fusion("mine", Mine)
"""
NET = """
from torch import nn
from models.layers.head import Linear

class Net(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer, self.head = Linear(3, 8), Linear(8, 3)

    def forward(self, points):
        return self.head(self.layer(points))
"""
SETTINGS = (
    "model.fusion=mine", "data.shapes.count=4", "data.shapes.held_out=2", "data.points=64", "data.touch.points=32",
    "train.epochs=1", "train.batch=2", "model.encoder.channels=8", "model.backbone.channels=[8]",
    "evaluate.metrics=[cd]", "evaluate.examples=1",
)  # fmt: skip


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """A plugin file that imports a module beside it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path / "lab")  # what the plugin prepends is taken back
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "pcsr_test_beside.py").write_text("from torch.nn import Linear\n")
    path = tmp_path / "lab" / "mine.py"
    path.write_text(PLUGIN)
    return path


def git(folder, *words):
    about = ("-c", "user.name=x", "-c", "user.email=x@example.org")
    subprocess.run(["git", "-C", str(folder), *about, *words], check=True, capture_output=True)


def test_the_record_has_recipe_versions_command_and_plugin_files(plugin, tmp_path):
    registry = load_plugins([plugin])
    (recipe,) = load(SMOKE, registry, ["model.fusion=mine"])
    record(tmp_path / "run", "training", recipe, registry, "pcsr run smoke")
    assert json.loads((tmp_path / "run" / "recipe.json").read_text()) == recipe.resolved()
    about = read_environment(tmp_path / "run")["training"]
    assert about["command"] == "pcsr run smoke"
    assert about["packages"]["torch"] == version("torch")
    assert about["plugins"] == {"plugins/mine/mine.py": recipe.code["model.fusion"]}
    copies = tmp_path / "run" / "plugins" / "mine"
    assert {path.name: path.read_bytes() for path in copies.iterdir()} == {
        path.name: path.read_bytes() for path in plugin.parent.glob("*.py")
    }
    assert file_code(copies / "mine.py") == recipe.code["model.fusion"], "the copy has the same code"


def test_a_stage_keeps_the_record_of_the_other_and_replaces_a_damaged_one(plugin, tmp_path):
    registry = load_plugins([plugin])
    (recipe,) = load(SMOKE, registry)
    for stage, command in (("training", "one"), ("evaluation", "two"), ("evaluation", "three")):
        record(tmp_path, stage, recipe, registry, command)
    stages = read_environment(tmp_path)
    assert {stage: about["command"] for stage, about in stages.items()} == {"training": "one", "evaluation": "three"}
    assert not (tmp_path / "plugins").exists(), "the recipe names no part of the file"
    (tmp_path / "environment.json").write_text("{")
    record(tmp_path, "evaluation", recipe, registry, None)
    assert read_environment(tmp_path).keys() == {"evaluation"}


def test_files_of_one_name_are_kept_apart(tmp_path):
    files = []
    for folder, kind in (("a", "Metric"), ("b", "Baseline")):
        (tmp_path / folder).mkdir()
        files.append(tmp_path / folder / "mine.py")
        files[-1].write_text(
            f"from pcsr import {kind}, hookimpl\nclass Own({kind}):\n    pass\n"
            f"@hookimpl\ndef pcsr_register(register):\n    register.{kind.lower()}('own', Own)\n"
        )
    registry = load_plugins(files)
    (recipe,) = load(SMOKE, registry, ["evaluate.metrics=[cd, own]", "evaluate.baselines=[own]"])
    assert plugin_files(recipe, registry) == {"mine": files[0], "mine-2": files[1]}


def test_the_modules_that_a_network_imports_are_copied_with_it(tmp_path):
    """They lie in the folder of its file and in one above it, in packages without an `__init__.py`."""
    files = {
        "made/network.py": "from made.sizes import width\nfrom models.net import Net\n",
        "made/sizes.py": "width = 8\n",
        "models/net.py": NET,
        "models/layers/head.py": "from torch.nn import Linear\n",
        "models/other.py": "",
    }
    for name, text in files.items():
        path = tmp_path / "repository" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    text = "extends: {}\nname: tiny\nmodel: {{graft: {{network: repository/made/network.py:Net, at: layer}}}}\n"
    (tmp_path / "tiny.yaml").write_text(text.format(SMOKE.as_posix()))
    registry = load_plugins()
    (recipe,) = load(tmp_path / "tiny.yaml", registry)
    record(tmp_path / "run", "training", recipe, registry, None)
    about = read_environment(tmp_path / "run")["training"]
    assert about["plugins"] == {"plugins/network/made/network.py": recipe.code["model.graft.network"]}
    copies = tmp_path / "run" / "plugins" / "network"
    found = {path.relative_to(copies).as_posix() for path in copies.rglob("*.py")}
    assert found == {"made/network.py", "made/sizes.py", "models/net.py", "models/layers/head.py"}
    shutil.rmtree(tmp_path / "repository")
    again = load_plugins([copies / "made" / "network.py"])
    (repeated,) = load(tmp_path / "run" / "recipe.json", again)
    assert repeated.fingerprint == recipe.fingerprint


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_the_commit_is_that_of_the_folder(tmp_path):
    assert commit(tmp_path) is None
    git(tmp_path, "init", "-q")
    assert commit(tmp_path) is None, "there is no commit yet"
    (tmp_path / "a.txt").write_text("a")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "one")
    (tmp_path / "inner").mkdir()
    found = commit(tmp_path / "inner")
    assert found["repository"] == tmp_path.name
    assert len(found["commit"]) == 40
    assert found["changed"] is False
    (tmp_path / "a.txt").write_text("b")
    assert commit(tmp_path)["changed"] is True
    assert [one["commit"] for one in environment(None, [tmp_path, tmp_path / "inner"])["git"]] == [found["commit"]]


def test_without_git_there_is_no_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert commit(tmp_path) is None


@pytest.mark.slow
def test_a_run_is_repeated_from_its_folder(plugin, tmp_path):
    def run(*words):
        done = CliRunner().invoke(pcsr, ["run", *map(str, words), "--jobs", "1"])
        assert done.exit_code == 0, done.output

    run(SMOKE, *(f"--set={setting}" for setting in SETTINGS), "--plugin", plugin)
    (folder,) = Path("runs").glob("smoke-*")
    stages = read_environment(folder)
    assert stages.keys() == {"training", "evaluation"}
    assert stages["training"]["command"].startswith(f"pcsr run {SMOKE} --set=model.fusion=mine")
    run(folder / "recipe.json", "--plugin", folder / "plugins/mine/mine.py", "--runs", "repeated")
    one, other = (read_results(runs / folder.name / "results.json") for runs in (Path("runs"), Path("repeated")))
    assert one.fingerprint == other.fingerprint
    assert one.methods[0].values == other.methods[0].values
