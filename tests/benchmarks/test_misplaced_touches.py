"""benchmarks/misplaced_touches.py: touches of an arm with errors do harm as reported, and help when registered."""

import importlib
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr import PoseError
from pcsr.recorded import read

pytest.importorskip("embreex")
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script = importlib.import_module("misplaced_touches")

PART = "test/bolt/0000"


def test_misplaced_touches_harm_as_reported_and_help_when_registered(tmp_path):
    scene = script.Scene.write(PART, tmp_path, seed=0)
    assert read(tmp_path / "touches").pose_error == PoseError(1.0, 2.0)
    plain, reported, registered = (scene.error(options) for options in list(script.COMMANDS.values())[:3])
    assert registered < 0.9 * plain < plain < 0.9 * reported
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [one["verdict"] for one in report["touches"]].count("refused") < 4


def test_the_picture_is_written(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(script, "DRAWN", (PART, 0))
    done = CliRunner().invoke(script.main, ["--picture", str(tmp_path / "touch.png")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "touch.png").read_bytes().startswith(b"\x89PNG")


def test_parts_that_cannot_be_touched_are_left_out(monkeypatch):
    monkeypatch.setattr(script, "SIZE", 5.0)
    done = CliRunner().invoke(script.main, [PART])
    assert (done.exit_code, "left out: " in done.stderr, "no part could be touched" in done.stderr) == (1, True, True)
