"""`pcsr runs` and `pcsr report`: run folders are listed, shown, removed, and their reports made again."""

import json
import os
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.errors import RunError, UserError
from tests.small_run import put, unfinish


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def invoke(*words, code=0, text=None):
        done = CliRunner().invoke(pcsr, list(map(str, words)), input=text)
        assert done.exit_code == code, done.output
        return done.output

    return invoke


@pytest.fixture
def runs(tmp_path):
    """Three runs, of which the last is unfinished and the first the oldest."""
    folders = [put(tmp_path / "runs" / f"{name}-1", name, factor=factor, fusion=fusion)
               for name, factor, fusion in (("a", 0.5, "none"), ("b", 0.25, "mine"), ("c", 1.0, "none"))]  # fmt: skip
    unfinish(folders[2])
    for k, folder in enumerate(folders):
        for path in folder.iterdir():
            os.utime(path, (1e9 + k, 1e9 + k))
    return folders


def listed(text):
    return [line.split()[0] for line in text.splitlines() if line[:3] in ("a-1", "b-1", "c-1")]


def test_runs_are_listed_newest_first_with_what_differs_in_columns(call, runs):
    text = call("runs")
    assert listed(text) == ["c-1", "b-1", "a-1"]
    head = next(line for line in text.splitlines() if "seed" in line)
    assert "fusion" in head
    assert "encoder" not in head
    assert "All have data.shapes cad-parts, model.encoder unet, train.objective chamfer." in " ".join(text.split())
    assert "mine#0123456789ab" in text
    assert "2 epochs, 8 steps" in text
    assert "runs/c-1: unfinished, training stopped after step 8" in text
    assert "3 runs" in text


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("--sort", "cd"), ["b-1", "a-1", "c-1"]),
        (("--sort", "cd", "--reverse"), ["a-1", "b-1", "c-1"]),
        (("--sort", "name"), ["a-1", "b-1", "c-1"]),
        (("--where", "fusion=none"), ["c-1", "a-1"]),
        (("--where", "fusion=none", "--where", "state=finished"), ["a-1"]),
        (("--where", "name=[ab]-*", "--sort", "name"), ["a-1", "b-1"]),
        (("--where", "name=a"), ["a-1"]),
        (("--where", "fusion=mine"), ["b-1"]),
        (("--where", "fusion=mine#0123456789ab"), ["b-1"]),
        (("--where", "model.fusion=mine#*"), ["b-1"]),
        (("--where", "train.epochs=2", "--where", "seed=0"), ["c-1", "b-1", "a-1"]),
    ],
)
def test_they_are_chosen_and_sorted(call, runs, words, names):
    assert listed(call("runs", *words)) == names


def test_where_nothing_matches_it_says_so(call, runs):
    assert call("runs", "--where", "fusion=concat") == "no run in runs matches; it has 3\n"
    said = call("runs", "--sort", "hd", code=UserError.exit_code)
    assert "--sort hd: no run has such a value: known: age" in said
    assert said.endswith(", and keys of the recipe such as train.epochs\n")
    assert "write KEY=PATTERN" in call("runs", "--where", "fusion", code=UserError.exit_code)
    assert "name it with --runs" in call("runs", "--runs", "elsewhere", code=UserError.exit_code)
    Path("elsewhere").mkdir()
    assert call("runs", "--runs", "elsewhere") == "no run in elsewhere\n"


def test_the_list_is_plain_data_too(call, runs):
    one, *_ = json.loads(call("runs", "--json", "--sort", "cd"))
    assert (one["folder"], one["state"], one["epochs"], one["steps"]) == ("runs/b-1", "finished", 2, 8)
    assert one["metrics"].keys() == {"cd"}
    assert one["parts"]["model.fusion"] == "mine#0123456789ab"


def test_a_run_is_shown_with_the_command_that_repeats_it(call, runs):
    about = {"time": "now", "command": "pcsr run b.yaml --plugin mine.py", "pcsr": "0.3", "python": "3.11",
             "system": "Linux", "packages": {"torch": "2.6"}, "plugins": {"plugins/mine/mine.py": "0123456789ab"},
             "git": [{"repository": "lab", "commit": "abc", "changed": True}]}  # fmt: skip
    (runs[1] / "environment.json").write_text(json.dumps({"training": about}))
    text = call("runs", "show", "b")
    assert "pcsr run b.yaml --plugin mine.py; training" in text
    assert "lab abc, with changes" in text
    assert "pcsr 0.3, torch 2.6, Python 3.11, Linux, now" in text
    repeat = next(line for line in text.splitlines() if line.startswith("repeat")).split(maxsplit=1)[1]
    words = shlex.split(repeat)
    assert words == ["pcsr", "run", "runs/b-1/recipe.json", "--plugin", "runs/b-1/plugins/mine/mine.py", "--runs",
                     "repeated"]  # fmt: skip
    assert "metrics.jsonl" in text
    assert "midpoint" in text


def test_an_unfinished_run_and_a_damaged_record_are_shown(call, runs):
    (runs[2] / "environment.json").write_text("[")
    text = call("runs", "show", runs[2])
    assert "unfinished: training stopped after step 8" in text
    assert "environment.json:1: Expecting value" in text


@pytest.mark.parametrize("key", ["git", "plugins"])
@pytest.mark.parametrize("written", [1, [1], [[]], "x", None])
def test_a_record_of_the_environment_of_other_types_is_remarked(call, runs, key, written):
    (runs[1] / "environment.json").write_text(json.dumps({"training": {key: written}}))
    assert f"environment.json: training.{key} is not " in call("runs", "show", "b-1")


def test_runs_are_removed_after_a_question(call, runs):
    assert "Remove this run?" in call("runs", "rm", "a", code=1, text="n\n")
    assert runs[0].exists()
    assert "removed runs/a-1" in call("runs", "rm", "a", text="y\n")
    said = call("runs", "rm", "--yes", "b-1", "c-1", "b-1")
    assert said.count("removed") == 2
    assert not list(Path("runs").iterdir())


def test_runs_are_removed_by_patterns_and_values_after_a_question_with_their_list(call, runs, tmp_path):
    put(tmp_path / "runs" / "ab-1", "ab", fusion="mine")
    said = call("runs", "rm", "a*", "--where", "fusion=none", code=1, text="n\n")
    assert "runs/a-1: finished" in said
    assert "Remove this run?" in said
    said = call("runs", "rm", "runs/a*", code=1, text="n\n")
    assert "runs/a-1: finished" in said
    assert "Remove these 2 runs?" in said
    call("runs", "rm", "--where", "fusion=mine", text="y\n")
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {"a-1", "c-1"}
    for words, why in (
        (("x-*",), "no run in runs matches 'x-*'"),
        (("a*", "--where", "state=unfinished"), "no run matches state=unfinished"),
        (("--where", "fusion=concat"), "no run matches fusion=concat"),
        ((), "no run is named"),
    ):
        assert why in call("runs", "rm", *words, code=UserError.exit_code)
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {"a-1", "c-1"}


def test_the_current_folder_is_removed_by_its_name(call, runs, monkeypatch):
    monkeypatch.chdir(runs[0])
    assert "removed ." in call("runs", "rm", "--yes", ".")
    assert not runs[0].exists()


def test_only_run_folders_are_removed(call, runs, tmp_path):
    (tmp_path / "notes").mkdir()
    Path("link").symlink_to(runs[0])
    (tmp_path / "project" / ".git").mkdir(parents=True)
    for other in ("project", "runs"):
        (tmp_path / other / "results.json").write_text("{}")
    for named, why in (
        *(("notes", "is no run folder"), ("link", "is a link"), ("x", "there is no run 'x'")),
        *(("project", "project holds a git repository"), ("runs", "runs holds another run, a-1")),
    ):
        assert why in call("runs", "rm", "--yes", "b", named, code=UserError.exit_code)
    assert all(folder.exists() for folder in runs)


def test_what_an_interrupted_removal_left_is_removed_with_the_next(call, runs):
    left = Path("runs/.a-1.removed")
    left.mkdir()
    (left / "weights.safetensors").touch()
    assert "removed runs/a-1" in call("runs", "rm", "--yes", "a")
    assert not runs[0].exists()
    assert not left.exists()


def test_a_folder_that_cannot_be_removed_is_an_error_of_one_line(call, runs, monkeypatch):
    def read_only(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "rename", read_only)
    said = call("runs", "rm", "--yes", "a", code=RunError.exit_code)
    assert said.splitlines()[-1] == "pcsr: error: runs/a-1 can't be removed: Read-only file system"


def test_reports_are_written_again(call, runs, tmp_path):
    assert call("report", runs[0], runs[1]).splitlines() == [f"{run}/report.html" for run in runs[:2]]
    assert call("report", "a") == "runs/a-1/report.html\n"
    assert call("report", "b-1", "--runs", tmp_path / "runs") == f"{runs[1]}/report.html\n"
    assert "<h1>a</h1>" in (runs[0] / "report.html").read_text(encoding="utf-8")
    assert call("report", runs[0], "-o", "a.html") == "a.html\n"
    assert Path("a.html").read_bytes() == (runs[0] / "report.html").read_bytes()


def test_reports_of_other_folders_are_refused(call, runs, tmp_path):
    (tmp_path / "notes").mkdir()
    for words, why in (
        ((runs[2],), "runs/c-1/results.json is missing; do `pcsr run` again"),
        (("notes",), "notes is no run folder"),
        (("nowhere",), "there is no run 'nowhere'"),
        ((runs[0], runs[1], "-o", "x.html"), "it is the page of one run, and 2 are named"),
    ):
        assert why in call("report", *words, code=UserError.exit_code)
    assert not (runs[0] / "report.html").exists()
