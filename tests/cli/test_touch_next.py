"""`pcsr touch next` and `pcsr touch explore` as a person runs them."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.clouds.formats import read_cloud
from pcsr.plugins.loading import load_plugins
from pcsr.testing import check_part
from tests.exploration.scenes import ball, upper

MINE = """
import pcsr

class Lowest(pcsr.Policy):
    def __init__(self, *, sign: float = -1.0) -> None:
        self.sign = sign

    def scores(self, candidates, cloud, touched):
        return self.sign * candidates.points[:, 2]

@pcsr.hookimpl
def pcsr_register(register):
    register.policy("lowest", Lowest)
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savetxt("scan.xyz", upper(ball(900), above=1.0))
    (tmp_path / "mine.py").write_text(MINE)
    return lambda *words: CliRunner().invoke(pcsr, ["touch", *map(str, words)])


def test_poses_are_shown_and_written(run, tmp_path):
    result = run("next", "scan.xyz", "--count", 2, "-o", "next.json", "-o", "next.ply", "--frame", "camera")
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0].startswith("0: at ")
    assert lines[0].endswith("on a guessed side")
    assert lines[2].startswith("The cloud seems to be seen from one side, direction ")
    assert lines[3:] == ["next.json: 2 poses", "next.ply: 2 poses"]
    content = json.loads((tmp_path / "next.json").read_text())
    assert len(content["touches"]) == 2 == len(read_cloud(tmp_path / "next.ply").points)
    assert content["touches"][1]["ros"]["header"]["frame_id"] == "camera"


def test_metres_are_named_or_refused(run):
    np.savetxt("metres.xyz", upper(ball(900), above=1.0) / 1000)
    refused = run("next", "metres.xyz")
    assert refused.exit_code != 0
    assert "smaller than the gel of sensor 'digit' (16 × 12 mm): name the cloud's unit" in refused.stderr
    named = run("next", "metres.xyz", "--unit", "m", "--count", 1)
    assert named.exit_code == 0, named.output
    assert "0: at " in named.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--unit", "ell"), "unit is 'ell': name it"),
        (("--camera", "0", "0", "5"), "inside of the cloud"),
        (("--camera", "0", "0", "99", "--all-around"), "give either camera"),
        (("-o", "next.txt"), ".json or .ply"),
        (("-o", "scan.xyz"), ".json or .ply"),
        (("--sensor", "digitt"), "pcsr: error: --sensor: there is no sensor 'digitt': did you mean 'digit'"),
        (("--policy", "spars"), "did you mean 'sparse'"),
        (("--touch-as-is",), "--touch, which is not given"),
        (("--touch", "nowhere"), "nowhere"),
    ],
)
def test_mistakes_are_one_line(run, words, message):
    result = run("next", "scan.xyz", *words)
    assert result.exit_code != 0
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def test_touches_so_far_are_used(run):
    ball_mesh = trimesh.creation.icosphere(radius=15)
    ball_mesh.export("ball.stl")
    options = ("--object-size", "null", "--count", 2, "--policy", "sparse", "--cloud", "scan.xyz")
    made = run("ball.stl", *options, "-o", "touches")
    assert made.exit_code == 0, made.output
    lost = sorted(Path("touches").glob("*.ply"))[-1]
    plain, touched = run("next", "scan.xyz", "--count", 1), run("next", "scan.xyz", "--touch", "touches", "--count", 1)
    assert touched.exit_code == 0, touched.output
    assert plain.stdout != touched.stdout
    lost.unlink()
    assert "is skipped" in run("next", "scan.xyz", "--touch", "touches", "--count", 1).stderr


def test_a_policy_of_a_file_is_used_everywhere(run, tmp_path):
    outcomes = check_part(load_plugins([tmp_path / "mine.py"]).get("policy", "lowest"))
    assert not [one for one in outcomes if one.result == "failed"]
    result = run("next", "scan.xyz", "--policy", "lowest", "--plugin", "mine.py", "--count", 1)
    assert result.exit_code == 0, result.output
    assert "mm²)" not in result.stdout  # it expects no gain
    trimesh.creation.box((30, 20, 15)).export("box.stl")
    options = ("--object-size", "null", "--count", 1, "--points", 256, "--candidates", 20)
    explored = run("explore", "box.stl", "--plugin", "mine.py", "--policy", "lowest", "--policy", "uniform", *options)
    assert explored.exit_code == 0, explored.output
    rows = dict(line.split(None, 1) for line in explored.stdout.splitlines()[:3])
    assert list(rows) == ["touches", "lowest", "uniform"]
    cells = [[float(x) for x in rows[name].split()] for name in ("lowest", "uniform")]
    before, after, failed = zip(*cells, strict=True)
    assert before[0] == before[1] not in after
    assert min(after) > 0
    assert min(failed) >= 0


def test_a_command_may_be_left_out_before_a_mesh(run):
    trimesh.creation.icosphere(radius=15).export("ball.stl")
    for words in (("ball.stl",), ("simulate", "ball.stl")):
        result = run(*words, "-o", f"made-{len(words)}", "--count", 1)
        assert result.exit_code == 0, result.output
    assert "simulate" in run("--help").output
    assert run().exit_code != 0
