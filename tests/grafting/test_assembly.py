"""Parts that are installed, and the page about grafts: its code runs from top to bottom, and so do its commands."""

import contextlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.clouds.formats import read_points, write_points
from pcsr.grafting import Grafted, graft
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.recipe.graft_section import Graft
from pcsr.recorded import write
from tests.grafting.networks import Meeting

TEXT = (Path(__file__).parents[2] / "docs" / "graft.md").read_text(encoding="utf-8")
NETWORK, EXAMPLE, _ = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
(RECIPE,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
COMMANDS = re.findall(r"^pcsr (.*)$", TEXT, re.MULTILINE)


WRONG_TYPES = """
import sys
import pcsr
from tests.grafting.networks import Meeting

for words, options, why in (
    ((Meeting, "layer"), {}, "give a torch.nn.Module, an instance of its class"),
    ((Meeting(None), Meeting(None).layer), {}, "give the dotted name of a layer"),
    ((Meeting(None), "layer"), {"plugins": "mine.py"}, "plugins='mine.py' is one file"),
):
    try:
        pcsr.graft(*words, **options)
    except pcsr.UserError as error:
        if why not in str(error):
            sys.exit(f"{error} says nothing of: {why}")
    else:
        sys.exit(f"accepted: {words}")
"""


def test_a_network_a_layer_and_plugins_of_another_type_are_named():
    """In a process without the tests' check of types, which would refuse them first."""
    environment = {**os.environ, "JAXTYPING_DISABLE": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", WRONG_TYPES], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr


def test_installed_plugins_are_found_without_a_registry():
    assert graft(Meeting(None), "layer").specs["fusion"] == {
        "use": "iterative",
        "pool": "none",
        "pairing": "hilbert",
        "offsets": False,
        "negative_slope": 0.0,
    }


@pytest.fixture
def page(tmp_path, monkeypatch):
    """Run the Python of the page, in a folder with its files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "their_network.py").write_text(NETWORK)
    (tmp_path / "touched.yaml").write_text(RECIPE)
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(None):
        exec(EXAMPLE, names)
    return names


@pytest.mark.slow
def test_the_documented_examples_and_commands_run(page, tmp_path):
    assert isinstance(page["grafted"], Grafted)
    directions = np.random.default_rng(0).normal(size=(80, 3))
    cloud = 50 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    write_points(Path("scan.ply"), cloud)
    write(Path("touches"), [pcsr.Touch.single(cloud[:20], None, 1.0, "digit")])
    assert [line.split()[0] for line in COMMANDS] == ["compare", "upsample"]
    for line in COMMANDS:
        done = CliRunner().invoke(command, shlex.split(line))
        assert done.exit_code == 0, done.output
    assert len(read_points(tmp_path / "dense.ply")) == 320
    assert (tmp_path / "runs" / "compare.html").is_file()


def test_the_recipe_is_good_and_its_keys_are_described(tmp_path):
    (tmp_path / "their_network.py").write_text(NETWORK)
    (tmp_path / "touched.yaml").write_text(RECIPE)
    names = [recipe.name for recipe in load(tmp_path / "touched.yaml", load_plugins())]
    assert names == ["touched-touches.0", "touched-touches.2"]
    table = re.search(r"^\| key of `model\.graft`.*?\n\n", TEXT, re.MULTILINE | re.DOTALL)[0]
    heads = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    assert {name for head in heads for name in re.findall(r"`(\w+)`", head)} == set(Graft.model_fields)
