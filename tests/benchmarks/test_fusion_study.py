"""benchmarks/fusion_study.py: which runs count, and what the tables say of them."""

import importlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    study = importlib.import_module("fusion_study")
    study_runs = importlib.import_module("study_runs")
REGISTRY = load_plugins()
FINGERPRINTS = {one.name: one.fingerprint[:8] for one in study_runs.recipes(study.STUDY)}


@pytest.fixture
def runs(tmp_path):
    (tmp_path / "runs").mkdir()
    return tmp_path / "runs"


def put(runs, name, steps=(1000, 20000), fingerprint=None):
    """Write the run folder of a row and seed, whose snapshots have been measured."""
    folder = runs / f"{name}-{fingerprint or FINGERPRINTS[name]}"
    folder.mkdir()
    measured = numbers([4e-3, 2e-3], [3e-3, 2e-3], [4e-3, 2e-3], [2e-3, 0.0])
    content = {f"weights-{step}.safetensors": {"sha256": "0", "cd": measured} for step in steps}
    (folder / "snapshots.json").write_text(json.dumps(content))
    return folder


def test_rows_are_those_of_the_study_in_its_order_and_runs_of_one_row_are_its_seeds(runs):
    put(runs, "fusions-nearest-seed.1")
    put(runs, "fusions-nearest-seed.0")
    put(runs, "fusions-iterative-seed.0", steps=(1000,))
    put(runs, "fusions-iterative-seed.1", fingerprint="00000000")  # of other settings
    put(runs, "fusions-concat-seed.0", steps=())
    put(runs, "fusions-unknown-seed.0", fingerprint="00000001")
    rows = study.read(runs, REGISTRY)
    assert {row: {step: len(seeds) for step, seeds in of.items()} for row, of in rows.items()} == {
        "iterative": {1000: 1},
        "nearest": {1000: 2, 20000: 2},
    }
    assert list(rows) == ["iterative", "nearest"]


def test_without_snapshots_it_says_what_makes_some(runs):
    with pytest.raises(UserError, match=r"runs holds no snapshot of the study: `pcsr run fusions/study --runs "):
        study.read(runs, REGISTRY)


def test_numbers_that_are_kept_are_shown_with_those_of_later_runs(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(study_runs, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(study, "KEPT", tmp_path / "kept")
    saved = {}
    monkeypatch.setattr(study, "save", lambda name, command, columns, lines: saved.update({name: lines}))
    for name in ("fusions-pool-seed.0", "fusions-iterative-seed.1"):
        path = put(runs, name)
        done = CliRunner().invoke(study.main, [str(runs), "--save"])
        assert done.exit_code == 0, done.output
        shutil.rmtree(path)
    assert [line[:3] for line in saved["fusion-study"]] == [["`iterative`", "1", "20,000"], ["`pool`", "1", "20,000"]]
    assert {path.name for path in (tmp_path / "kept").rglob("*.*") if path.is_file()} == {"snapshots.json"}


def numbers(without, own, other, replaced):
    moved = np.subtract(without, own).tolist()
    of_touch = {"without": without, "own": own, "other": other, "replaced": replaced}
    return {**of_touch, "moved": moved, "features": [2 * one for one in without]}


ROWS = {
    "a": {
        1: [numbers([4e-3, 2e-3], [3e-3, 2e-3], [4e-3, 2e-3], [2e-3, 0.0])] * 2,
        5: [numbers([4e-3, 2e-3], [2e-3, 2e-3], [5e-3, 2e-3], [2e-3, 0.0])],
    },
    "b": {5: [numbers([4e-3, 2e-3], [4e-3, 2e-3], [4e-3, 2e-3], [4e-3, 2e-3])]},
}


def test_a_line_is_of_the_last_step_that_all_seeds_have_reached():
    assert study.table(ROWS) == [
        [
            "`a`",
            "2",
            "1",
            "3.000 ± 0.000",
            "2.500 ± 0.000",
            "3.000 ± 0.000",
            "0.250 ± 0.000",
            "0.000 ± 0.000",
            "0.500 ± 0.000",
            "6.000 ± 0.000",
        ],
        ["`b`", "1", "5", "3.000", "3.000", "3.000", "–", "–", "0.000", "6.000"],
    ]
    assert study.over_steps(ROWS) == [["row", "1", "5"], ["`a`", "0.250 ± 0.000", "0.500"], ["`b`", "–", "–"]]


def test_the_command_prints_the_tables_and_draws_the_picture(runs, tmp_path):
    put(runs, "fusions-iterative-seed.0")
    put(runs, "fusions-concat-seed.0")
    done = CliRunner().invoke(study.main, [str(runs), "-o", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "| `iterative` | 1     | 20,000 |" in done.output
    assert (tmp_path / "fusion-study.png").stat().st_size > 1000
