"""benchmarks/camera_direction.py: the errors of known directions, and the table."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr.data.view

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script = importlib.import_module("camera_direction")


def test_errors_are_angles_to_the_camera(monkeypatch):
    seen = []
    monkeypatch.setattr(script, "seen_from", lambda points: seen.append(points) or np.array([0.0, 0.0, 1.0]))
    monkeypatch.setattr(script, "spread_directions", lambda count, rng: np.array([[0.0, 1.0, 0.0]]))
    assert script.angles(1, 1, 2) == pytest.approx([90, 90])
    assert [len(points) for points in seen] == [512, 512]


def test_the_command_prints_a_row_for_each_kind_of_cloud():
    before = pcsr.data.view.spread_directions
    result = CliRunner().invoke(script.main, ["--parts", "1", "--seeds", "1"])
    assert result.exit_code == 0, result.output
    for what in ("1 camera ", "2 cameras", "4 cameras", "random points"):
        assert what in result.output
    assert pcsr.data.view.spread_directions is before
