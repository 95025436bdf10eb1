"""`pcsr compare`: parts against each other on the same data, to one table and one page."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.errors import UserError

SMOKE = str(Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml")
TINY = [
    f"--set={setting}"
    for setting in (
        "data.shapes.count=8", "data.shapes.held_out=2", "data.points=64", "data.touch.points=32", "train.epochs=1",
        "model.encoder.channels=8", "model.backbone.channels=[8]", "evaluate.metrics=[cd]", "evaluate.examples=1",
    )
]  # fmt: skip


@pytest.fixture
def compare(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(pcsr, ["compare", *arguments, "--jobs", "1"])


@pytest.mark.slow
def test_two_fusions_and_two_seeds_become_one_table_and_one_page(compare, tmp_path):
    done = compare(SMOKE, *TINY, "--fusion", "concat", "--fusion", "iterative", "--seeds", "2", "--name", "mine")
    assert done.exit_code == 0, done.output
    stages = ("building the train data", "building the validation data", "building the test data", "training, loss")
    for stage in (*stages, "evaluating"):
        assert [line.startswith(stage) for line in done.stderr.splitlines()].count(True) == 4, "one line each"
    summaries = re.findall(r"^(\S+): cd ×10³ [\d.]+ ± [\d.]+; report: runs/\S+/report.html$", done.stdout, re.M)
    assert summaries == [f"smoke-fusion.{fusion}-seed.{seed}" for fusion in ("concat", "iterative") for seed in (0, 1)]
    assert done.stdout.count("parameters") == 1, "the runs' own tables would say the same again"
    folders = sorted(path.name.rpartition("-")[0] for path in (tmp_path / "runs").glob("smoke-*"))
    assert folders == [f"smoke-fusion.{fusion}-seed.{seed}" for fusion in ("concat", "iterative") for seed in (0, 1)]
    assert len(list((tmp_path / "runs" / "data").iterdir())) == 1, "all saw the same data"
    page = (tmp_path / "runs" / "mine.html").read_text(encoding="utf-8")
    rows = [name for name in ("fusion.concat", "fusion.iterative", "midpoint") if f'scope="row">{name}' in page]
    assert rows == ["fusion.concat", "fusion.iterative", "midpoint"]
    assert "over the means of 2 seeds (0, 1)" in page
    assert '<th scope="row">model.fusion.use</th>' in page
    again = compare(SMOKE, *TINY, "--fusion", "concat", "--fusion", "iterative", "--seeds", "2", "--name", "mine")
    assert again.exit_code == 0
    assert "training, loss" not in again.output, "what is trained is not trained again"


@pytest.mark.parametrize("name", ["../x", "/x", "a/b", "", ".", "[red]", "x" * 101, "a\nb"])
def test_a_name_that_is_no_files_is_refused_before_anything_runs(compare, name, tmp_path):
    done = compare(SMOKE, *TINY, f"--name={name}")
    assert done.exit_code == UserError.exit_code
    assert "--name" in done.output
    assert not list(tmp_path.iterdir())


def test_runs_that_would_take_each_others_place_are_refused_before_anything_runs(compare, tmp_path):
    done = compare(SMOKE, SMOKE, *TINY)
    assert done.exit_code == UserError.exit_code
    assert "two of the runs are 'smoke'" in done.output
    assert not list(tmp_path.iterdir())
