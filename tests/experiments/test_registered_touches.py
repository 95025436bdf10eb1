"""A whole run on objects of which some have fewer touches than others, or none: data, training, report and pictures."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr.data.sample
from pcsr.cli import pcsr as command
from pcsr.registration import RegisteredTouch, Registration
from pcsr.run_files import read_run

SMALL = [
    "data.shapes.count=6", "data.shapes.held_out=3", "data.points=64", "data.registration={}",
    "model.encoder.channels=8", "model.touch_encoder.channels=4", "model.backbone.channels=[8, 16]",
    "train.epochs=1", "train.batch=3", "train.touches=[2, 2]", "evaluate.examples=3", "evaluate.metrics=[cd]",
]  # fmt: skip
pytestmark = pytest.mark.slow


@pytest.fixture
def numbers(monkeypatch):
    """Let one object in three keep all touches, one lose the first and half of the other, and one lose both."""
    found = []

    def register(touches, cloud, *, pose_error=None):
        kept = [[touch.points for touch in touches], [touches[0].points[:0], touches[1].points[::2]]]
        kept.append([touch.points[:0] for touch in touches])
        clouds = kept[len(found) % 3]
        found.append(sum(len(points) > 0 for points in clouds))
        registered = []
        for touch, points in zip(touches, clouds, strict=True):
            made = dataclasses.replace(touch, points=points, finger=touch.finger[: len(points)])
            errors = np.zeros(len(points))
            registered.append(RegisteredTouch(made, np.eye(4), np.zeros((6, 6)), errors, 0, "partly", ""))
        return Registration(registered, np.eye(4), np.zeros((6, 6)), 0.0, 0.0)

    monkeypatch.setattr(pcsr.data.sample, "register", register)
    return found


def test_a_run_on_objects_with_fewer_touches(numbers, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        result = CliRunner().invoke(command, list(map(str, words)), catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.output

    call("run", "smoke", "--jobs", 1, *(word for setting in SMALL for word in ("--set", setting)))
    assert set(numbers) == {0, 1, 2}
    (folder,) = (path.parent for path in tmp_path.glob("runs/*/results.json"))
    run = read_run(folder)
    counts = {one.name: one.touch_count for one in run.examples}
    assert set(counts.values()) == {0, 1, 2}
    effect = run.results.touch
    for name, touched, plain in zip(run.results.objects, effect.touched, effect.plain, strict=True):
        assert (touched == plain) == (counts[name] == 0)
    assert 0 < run.results.data.coverage < 1
    call("figures", folder, "-o", "pictures")
    assert (tmp_path / "pictures" / "touches.png").exists()
    (data,) = (path.parent for path in tmp_path.glob("**/manifest.json"))
    assert json.loads((data / "manifest.json").read_text())["data"]["registration"] == {
        "position": 1.0,
        "rotation": 2.0,
    }
    assert "all 3 files are intact" in call("data", "info", data, "--verify")
