"""`pcsr compare`: parts against each other on the same data, to one table and one page."""

import csv
import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import comparing, pcsr
from pcsr.errors import RunError, UserError
from pcsr.run_files import read_run
from tests.small_run import put, unfinish

SMOKE = str(Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml")
TINY = [
    f"--set={setting}"
    for setting in (
        "data.shapes.count=8", "data.shapes.held_out=2", "data.points=64", "data.touch.points=32", "train.epochs=1",
        "model.encoder.channels=8", "model.backbone.channels=[8]", "evaluate.metrics=[cd]", "evaluate.examples=1",
    )
]  # fmt: skip
FRAIL = """
import torch
from pcsr import Fusion, hookimpl

class Frail(Fusion):
    def __init__(self, widths):
        super().__init__()
        if torch.initial_seed() == 1:
            raise RuntimeError("seed 1 is too much")

    def forward(self, points, features, touches):
        return features

@hookimpl
def pcsr_register(register):
    register.fusion("frail", Frail)
"""


@pytest.fixture
def compare(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(pcsr, ["compare", *arguments, "--jobs", "1"])


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("raise RuntimeError('no')", "plugin mine.py cannot be loaded: RuntimeError: no"),
        (
            FRAIL.replace('"frail"', '"concat"'),
            "fusion 'concat' is registered twice, by pcsr and by mine.py: rename one of them",
        ),
    ],
)
def test_a_plugin_that_cannot_be_loaded_ends_it(compare, code, said):
    Path("mine.py").write_text(code)
    done = compare(SMOKE, "--plugin", "mine.py", "--fusion", "iterative", "--fusion", "concat")
    assert done.exit_code == UserError.exit_code
    assert said in done.stderr
    assert not Path("runs").exists()


@pytest.mark.slow
def test_two_fusions_and_two_seeds_become_one_table_and_one_page(compare, tmp_path):
    done = compare(SMOKE, *TINY, "--fusion", "concat", "--fusion", "iterative", "--seeds", "2", "--name", "mine")
    assert done.exit_code == 0, done.output
    stages = ("train data", "validation data", "test data", "training, loss")
    for stage in (*stages, "evaluating"):
        assert [line.startswith(stage) for line in done.stderr.splitlines()].count(True) == 4, "one line each"
    summaries = re.findall(r"^(\S+): cd ×10³ [\d.]+ ± [\d.]+; report: runs/\S+/report.html$", done.stdout, re.M)
    assert summaries == [f"smoke-fusion.{fusion}-seed.{seed}" for fusion in ("concat", "iterative") for seed in (0, 1)]
    assert done.stdout.count("parameters") == 1, "the runs' own tables would say the same again"
    folders = sorted(path.name.rpartition("-")[0] for path in (tmp_path / "runs").glob("smoke-*"))
    assert folders == [f"smoke-fusion.{fusion}-seed.{seed}" for fusion in ("concat", "iterative") for seed in (0, 1)]
    assert len(list((tmp_path / "runs" / "data").iterdir())) == 1, "all saw the same data"
    page = (tmp_path / "runs" / "mine.html").read_text(encoding="utf-8")
    rows = re.findall(r'<tr><th scope="row"><i[^>]*></i>(.*?)</th>', page)
    assert rows[:3] == ["fusion.concat", "fusion.iterative", "midpoint"]
    assert "over the means of 2 seeds (0, 1)" in page
    assert ">fusion concat<br>fusion.touches 5</td>" in page
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


@pytest.mark.slow
def test_a_fusion_without_touch_features_is_compared_without_the_touch_encoder(compare, tmp_path):
    done = compare(SMOKE, *TINY, "--fusion", "iterative", "--fusion", "none")
    assert done.exit_code == 0, done.output
    assert "fusion 'none' uses no touch features: it is compared without a touch encoder" in done.stderr
    encoders = {}
    for path in (tmp_path / "runs").glob("*/recipe.json"):
        model = json.loads(path.read_text())["model"]
        encoders[model["fusion"]["use"]] = model["touch_encoder"]
    assert encoders["none"] is None
    assert encoders["iterative"]["use"] == "unet"


@pytest.mark.slow
def test_a_seed_that_fails_is_left_out_and_said(compare, tmp_path):
    (tmp_path / "frail.py").write_text(FRAIL)
    words = (SMOKE, *TINY, "--fusion", "frail", "--seeds", "3", "--plugin", "frail.py", "--csv", "table.csv")
    done = compare(*words, "--set=evaluate.baselines=[]")
    assert done.exit_code == RunError.exit_code
    assert "smoke-fusion.frail-seed.1 failed: RuntimeError: seed 1 is too much" in done.stderr
    assert done.stderr.splitlines()[-1] == (
        "pcsr: error: 1 of 3 runs failed, see above: the same command runs them again"
    )
    assert "Left out: smoke-fusion.frail-seed.1 failed" in " ".join(done.stdout.split())
    (row,) = csv.DictReader((tmp_path / "table.csv").read_text().splitlines())
    assert row["seeds"] == "0 2"


def test_finished_runs_become_one_table_and_files(compare, tmp_path):
    for fusion, factor in (("none", 0.5), ("mine", 0.4)):
        for seed in (0, 1):
            name = f"net-fusion.{fusion}-seed.{seed}"
            put(tmp_path / "runs" / f"{name}-ab12", name, seed=seed, factor=factor, fusion=fusion)
    (tmp_path / "runs" / "net-study.html").touch()
    every = sorted(map(str, (tmp_path / "runs").glob("net-*")))  # as the shell expands runs/net-*
    done = compare(*every, "--latex", "out/table.tex", "--csv", "table.csv", "--markdown", "table.md")
    assert done.exit_code == 0, done.output
    assert "net-study.html is a page" in done.stderr
    assert "Differences from fusion.mine" in done.stdout
    lines = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert [(line["row"], line["seeds"], line["best"]) for line in lines] == [
        ("fusion.mine", "0 1", "True"), ("fusion.none", "0 1", "False"), ("midpoint", "0", "False"),
    ]  # fmt: skip
    assert float(lines[1]["p_holm"]) == pytest.approx(3 * 2 / 2**8)
    assert r"\textbf{" in (tmp_path / "out" / "table.tex").read_text(encoding="utf-8")
    assert "| fusion.none |" in (tmp_path / "table.md").read_text(encoding="utf-8")
    page = (tmp_path / "runs" / "compare.html").read_text(encoding="utf-8")
    assert 'href="net-fusion.mine-seed.0-ab12/report.html"' in page


def test_files_are_written_before_anything_is_printed(tmp_path, monkeypatch):
    class Closed:
        def print(self, *_, **__):
            raise BrokenPipeError

    monkeypatch.setattr(comparing.streams, "console", Closed)
    with pytest.raises(BrokenPipeError):
        comparing.show([read_run(put(tmp_path / "a"))], [], "page", tmp_path, {"latex": tmp_path / "t.tex"})
    assert (tmp_path / "t.tex").exists()
    assert (tmp_path / "page.html").exists()


def test_finished_runs_are_compared_with_recipes_that_are_run(compare, tmp_path):
    put(tmp_path / "old", points=64, rate=4, sampling="random")
    done = compare("old", SMOKE, *TINY, "--set=data.points=32")
    assert done.exit_code == UserError.exit_code
    assert "smoke has other test data than old: data.points is 32, not 64" in done.stderr
    assert not (tmp_path / "runs").exists(), "nothing was run"


def test_runs_on_other_clouds_are_refused_and_what_differs_is_named(compare, tmp_path):
    one, other = put(tmp_path / "a"), put(tmp_path / "b", points=64)
    done = compare(str(one), str(other))
    assert done.exit_code == UserError.exit_code
    assert f"{other} was measured on other clouds than {one}: data.points is 64, not 32" in done.stderr


def test_unfinished_and_damaged_runs_are_left_out_and_said(compare, tmp_path):
    put(tmp_path / "a")
    (put(tmp_path / "b", "other", factor=2.0) / "examples.safetensors").unlink()  # the numbers are there
    unfinish(put(tmp_path / "c"))
    (put(tmp_path / "d") / "results.json").write_text("{}")
    done = compare("a", "b", "c", "d")
    assert done.exit_code == 0, done.output
    said = done.stderr.splitlines()
    assert said[0].startswith("left out: c is not finished: it has no results.json")
    assert said[1].startswith("left out: d/results.json: name: ")
    assert len(said) == 2
    assert "Left out: c is not finished: it has no results.json; d/results.json" in " ".join(done.stdout.split())
    nothing = compare("c")
    assert nothing.exit_code == UserError.exit_code
    assert "no run is left to compare" in nothing.stderr


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("a", "a"), "a is named twice"),
        (("a", "empty"), "empty is no run folder"),
        (("a", "smok"), "'smok' is neither a run folder nor a recipe: did you mean 'smoke'?"),
        (("a", "x/y"), "'x/y' is neither a run folder nor a recipe: pcsr runs lists the run folders"),
        (("a", "--fusion", "none"), "only run folders are named: name a recipe too"),
        (("a", "--seeds", "2"), "only run folders are named: name a recipe too"),
        (("page.html",), "no run folder or recipe is named"),
        (("smoke", "--latex", "empty"), "empty is a folder, and would be replaced by a file"),
        (("smoke", "--latex", "x", "--csv", "./x"), "--latex and --csv name the same file, x: name two"),
        (
            ("smoke", "--markdown", "a/results.json"),
            "--markdown: a/results.json is a file of a run, which the tables would replace: name another",
        ),
    ],
)
def test_mistakes_in_what_is_compared_are_named(compare, tmp_path, words, why):
    put(tmp_path / "a")
    (tmp_path / "empty").mkdir()
    (tmp_path / "page.html").touch()
    done = compare(*words)
    assert done.exit_code == UserError.exit_code
    assert why in done.stderr
    assert not (tmp_path / "runs").exists()
