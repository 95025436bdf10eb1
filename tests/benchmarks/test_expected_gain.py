"""benchmarks/expected_gain.py: both ways of touching, resuming, and the table."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script = importlib.import_module("expected_gain")

FEW = ("--parts", "1", "--seeds", "1", "--tries", "60")


@pytest.mark.parametrize("way", [(), ("--guessed",)])
def test_what_is_measured_is_kept(way, tmp_path, monkeypatch):
    monkeypatch.setattr(script, "TOUCHES", 1)
    words = [*FEW, *way, "--policy", "uniform", "--policy", "expected-error", "--work", str(tmp_path)]
    first = CliRunner().invoke(script.main, words)
    assert first.exit_code == 0, first.output
    (file,) = tmp_path.iterdir()
    measured = json.loads(file.read_text())
    assert list(measured) == ["uniform", "expected-error"]
    assert np.isnan(measured["uniform"]["expected"]).all()
    assert measured["expected-error"]["expected"][0] > 0
    assert measured["uniform"]["before"] == measured["expected-error"]["before"]
    monkeypatch.setattr(script, "trial", None)  # nothing is measured anew
    again = CliRunner().invoke(script.main, words)
    assert again.exit_code == 0, again.output
    assert again.output == first.output


def test_the_row_compares_means_and_shares():
    one = script.Measured([2.0, 10.0], [1.0, 9.0], [0.5, 2.0], [0, 3], [0, 1])
    row = script.cells("sparse", one, 2)
    assert row == ["`sparse`", "6.000", "5.000", "-16.7% ± 20.0%", "-30.0%", "3", "1.25", "0.75", "0/2"]


def test_the_distance_is_symmetric():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(50, 3)), rng.normal(size=(70, 3))
    away = ((one[:, None] - other[None]) ** 2).sum(-1)
    assert script.distance(one, other) == pytest.approx(away.min(1).mean() + away.min(0).mean())
