"""docs/library.md: its code runs, its commands work, its tables are true."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr import Touch
from pcsr.cli import pcsr
from pcsr.clouds.formats import read_points, write_points
from pcsr.metrics import METRICS
from pcsr.network.card import __file__ as card
from pcsr.network.load import __file__ as loading
from pcsr.plugins.loading import check_loaded, load_plugins
from pcsr.recorded import write
from pcsr.testing import checks_for
from pcsr.weights.file import __file__ as weights_file
from pcsr.weights.fit import __file__ as fit

TEXT = (Path(__file__).parents[1] / "docs" / "library.md").read_text(encoding="utf-8")
CODE = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
COMMANDS = re.findall(r"^\$ pcsr (.*)$", TEXT, re.MULTILINE)


@pytest.mark.slow
def test_the_code_runs_from_top_to_bottom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(CODE) == 9
    exec("".join(CODE), {})


@pytest.mark.slow
def test_the_commands_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    directions = np.random.default_rng(0).normal(size=(300, 3))
    cloud = 50 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    write_points(Path("scan.ply"), cloud)
    write_points(Path("truth.ply"), cloud[::-1])
    trimesh.creation.icosphere(radius=50).export("ball.stl")
    write(Path("touches"), [Touch.single(cloud[:20], None, 1.0, "digit")])
    assert {line.split()[0] for line in COMMANDS} == {"upsample", "evaluate", "export"}
    for line in COMMANDS:
        result = CliRunner().invoke(pcsr, shlex.split(line))
        assert result.exit_code == 0, result.output
    assert len(read_points(Path("dense.ply"))) == 1200
    assert Path("model.onnx").is_file()


def test_the_metrics_are_all_there_and_described_as_they_describe_themselves():
    rows = dict(re.findall(r"^\| `([a-z0-9-]+)` \| ([A-Za-z].*) \|$", TEXT, re.MULTILINE))
    assert {name: rows[name] for name in METRICS} == {name: metric.description for name, metric in METRICS.items()}


def test_what_messages_are_said_to_say_they_say():
    said = re.findall(r"^\| [^|`]+ \| (`.*) \|$", TEXT, re.MULTILINE)
    files = [Path(file).read_text(encoding="utf-8") for file in (loading, card, weights_file, fit)]
    source = re.sub(r"\"\s*f?\"", "", "".join(files))
    fragments = [part for row in said for quoted in re.findall("`([^`]+)`", row) for part in quoted.split(" … ")]
    assert len(fragments) >= 9
    assert not [fragment for fragment in fragments if fragment not in source]


def test_the_fusion_of_the_readme_keeps_its_contract(tmp_path):
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", readme, re.DOTALL) if "pcsr_register" in block)
    (tmp_path / "my_fusion.py").write_text(code)
    registry = load_plugins([tmp_path / "my_fusion.py"])
    check_loaded(registry)
    fusion = registry.get("fusion", "my-attention")
    outcomes = [check.outcome() for check in checks_for(fusion)]
    assert len(outcomes) > 10
    assert not [one for one in outcomes if one.result == "failed"]
