"""`pcsr run` with weights that are trained already, and on several folders of data."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from safetensors.torch import load_file

from pcsr.cli import pcsr
from pcsr.errors import UserError
from pcsr.files import sha256
from pcsr.weights.file import read_card

ROOT = Path(__file__).parents[2]
SMALL = [
    f"--set={setting}"
    for setting in (
        "data.shapes=balls", "data.touch=caps", "data.points=32", "train.epochs=1", "train.batch=2",
        "model.encoder.channels=8", "model.backbone.channels=[8]", "model.upsampler=shuffle", "evaluate.metrics=[cd]",
        "evaluate.examples=1",
    )
]  # fmt: skip


@pytest.fixture
def call(tmp_path, monkeypatch, world):
    """Call pcsr in a folder of its own, with the parts of `world`."""
    monkeypatch.chdir(tmp_path)

    def invoke(*words, code=0):
        done = CliRunner().invoke(pcsr, [*map(str, words), "--plugin", str(world)])
        assert done.exit_code == code, done.output
        return done.output

    return invoke


@pytest.fixture
def data(call, tmp_path):
    """Two folders of data; the second has nothing but a split to train on."""
    settings = [f"--set={setting}" for setting in ("touch=caps", "points=32", "rate=4", "touches=2")]
    for name, more in (("one", ["--set=held_out=2"]), ("two", ["--set=seed=1"])):
        call("data", "make", "balls", "-o", tmp_path / name, *settings, "--set=count=4", *more, "--jobs=1")
    return tmp_path / "one", tmp_path / "two"


def run(call, *words, code=0):
    return call("run", *words, "--jobs=1", code=code)


def results(pattern):
    (path,) = Path("runs").glob(f"{pattern}/results.json")
    return json.loads(path.read_text(encoding="utf-8")), path.parent


def train(call, data):
    """Train a small network, and return the folder of its run."""
    run(call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0])
    return results("smoke-*")[1]


@pytest.mark.slow
def test_a_network_is_trained_on_several_folders_and_says_so(call, data):
    said = run(call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0], "--data", data[1])
    assert f"replaced by {data[0]} and {data[1]}, except" in " ".join(said.split())
    assert f"{data[1]} has no split 'test'" in said
    written, folder = results("smoke-*")
    card = read_card(folder / "weights.safetensors")
    assert written["training"]["steps"] == card["training"]["steps"] == 4, "8 objects, two at a time"
    assert [one["folder"] for one in card["data"]] == ["one", "two"]
    assert [one["objects"]["train"] for one in card["data"]] == [4, 4]
    assert card["data_fingerprint"] == written["data"]["fingerprint"]
    assert card["recipe"]["joined"] == [one["fingerprint"] for one in card["data"]]
    again = run(call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0], "--data", data[1])
    assert "finished: runs/smoke-" in again
    run(call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0])
    assert len(list(Path("runs").glob("smoke-*/weights.safetensors"))) == 2, "one folder is other data than two"


def test_a_recipe_of_joined_data_is_not_run_on_other_data(call, data):
    run(call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0], "--data", data[1])
    (path,) = Path("runs").glob("*/recipe.json")
    Path("again.yaml").write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    said = run(call, "again.yaml", code=UserError.exit_code)
    assert "uses 2 joined data sets: give the folder of each with --data" in said
    assert "finished: runs/smoke-" in run(call, "again.yaml", "--data", data[0], "--data", data[1])


@pytest.mark.slow
def test_finished_results_are_not_measured_again(call, data, monkeypatch):
    folder = train(call, data)
    words = (ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0])
    written = (folder / "results.json").read_bytes()
    (folder / "report.html").unlink()
    said = run(call, *words)
    assert "finished: runs/smoke-" in said
    assert "evaluating" not in said
    assert (folder / "results.json").read_bytes() == written
    assert (folder / "report.html").exists()
    assert "evaluating" in run(call, *words, "--reevaluate")
    assert "evaluating" in run(call, *words, "--set=evaluate.metrics=[cd, hd]"), "other metrics of the same weights"
    assert "evaluating" in run(call, *words)
    assert "evaluating" not in run(call, *words)
    (folder / "results.json").write_text("{}")
    assert "evaluating" in run(call, *words)
    monkeypatch.setattr("pcsr.experiments.finished_runs.own_code", lambda: "another version")
    assert "evaluating" in run(call, *words)


def test_folders_that_do_not_fit_are_refused_before_anything_is_written(call, data):
    call("data", "make", "balls", "-o", "three", "--set=touch=caps", "--set=points=64", "--set=count=1", "--jobs=1")
    said = run(
        call, ROOT / "pcsr/recipes/smoke.yaml", *SMALL, "--data", data[0], "--data", "three", code=UserError.exit_code
    )
    assert "cannot be joined: points is 32 in the first and 64 in the second" in said
    assert not Path("runs").exists()


@pytest.mark.slow
def test_a_study_puts_finished_weights_beside_others_on_other_data(call, data):
    file = train(call, data) / "weights.safetensors"
    Path("w.safetensors").write_bytes(file.read_bytes())
    Path("done.yaml").write_text("name: done\nweights: w.safetensors\n", encoding="utf-8")
    Path("study.yaml").write_text(
        "name: study\n"
        "recipes:\n"
        "  - done.yaml\n"
        "  - {use: done.yaml, name: far, data.shapes.count: 5}\n"
        "data: {shapes: {use: balls, count: 4, held_out: 3}, touch: caps, points: 48, rate: 4, touches: 1}\n"
        "train: {epochs: 50}\n"
        "evaluate: {metrics: [cd], examples: 1}\n",
        encoding="utf-8",
    )
    said = run(call, "study.yaml")
    assert "training, " not in said
    for name in ("study-done", "study-far"):
        written, folder = results(f"{name}-*")
        assert not (folder / "weights.safetensors").exists()
        training = read_card(file)["training"]
        assert {key: written["training"][key] for key in ("steps", "seconds", "device")} == {
            key: training[key] for key in ("steps", "seconds", "device")
        }
        assert written["training"]["source"] == f"w of recipe 'smoke', sha256 {sha256(file)[:12]}"
        assert written["recipe"]["train"]["epochs"] == 1, "as the weights were trained"
        assert (written["data"]["points"], written["data"]["touches"], len(written["objects"])) == (48, 1, 3)
    assert Path("runs/study.html").is_file()


@pytest.mark.slow
def test_weights_score_what_they_scored_when_they_were_trained(call, data):
    trained, folder = results(train(call, data).name)
    Path("w.yaml").write_text("name: w\nevaluate: {metrics: [cd]}\n", encoding="utf-8")
    run(call, "w.yaml", f"--set=weights={folder}/weights.safetensors", "--set=data.touches=2", "--data", data[0])
    written, _ = results("w-*")
    assert written["methods"][0]["values"] == trained["methods"][0]["values"]
    call("export", folder, "-o", "half.safetensors", "--half")
    assert {tensor.dtype.itemsize for tensor in load_file("half.safetensors").values()} <= {2, 8}
    run(call, "w.yaml", "--set=name=h", "--set=weights=half.safetensors", "--set=data.touches=2", "--data", data[0])
    halved, _ = results("h-*")
    assert halved["fingerprint"] != written["fingerprint"]
    assert halved["methods"][0]["values"]["cd"] == pytest.approx(written["methods"][0]["values"]["cd"], rel=0.01)


def test_weights_for_another_rate_are_refused_before_anything_runs(call, data):
    file = train(call, data) / "weights.safetensors"
    before = sorted(Path("runs").rglob("*"))
    settings = [f"--set={setting}" for setting in ("touch=caps", "points=32", "rate=2", "count=1", "held_out=1")]
    call("data", "make", "balls", "-o", "wide", *settings, "--jobs=1")
    Path("plain.yaml").write_text("name: plain\ndata: {touches: 0}\ntrain: {epochs: 1, touches: 0}\n", encoding="utf-8")
    rows = f"[plain.yaml, {{use: bare.yaml, weights: {file.resolve()}}}]"
    Path("bare.yaml").write_text("name: bare\ndata: {touches: 0}\n", encoding="utf-8")
    Path("study.yaml").write_text(f"name: s\nrecipes: {rows}\n", encoding="utf-8")
    said = run(call, "study.yaml", "--data", "wide", code=UserError.exit_code)
    assert "recipe 's-bare': data.rate is 2, and the weights have rate 4" in said
    assert sorted(Path("runs").rglob("*")) == before


def test_a_row_of_a_study_is_run_alone_and_the_study_then_finds_it(call, data, tmp_path):
    (tmp_path / "study.yaml").write_text("extends: smoke\nname: study\nmatrix: {train.learning_rate: [1e-3, 2e-3]}\n")
    words = ("study.yaml", *SMALL, "--data", data[0])
    run(call, *words, "--row", 2)
    (folder,) = Path("runs").glob("study-*")
    assert folder.name.startswith("study-learning_rate.0.002-")
    before = (folder / "weights.safetensors").read_bytes()
    printed = run(call, *words)
    assert "all runs: runs/study.html" in printed
    assert (folder / "weights.safetensors").read_bytes() == before
    printed = run(call, *words, "--row", 3, code=2)
    assert "--row 3: study.yaml has 2 runs: give a number from 1 to 2" in printed
