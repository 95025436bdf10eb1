"""Run folders in any state are listed, and their values found by name."""

import os
from pathlib import Path

import pytest

from pcsr.errors import UserError
from pcsr.run_folders import DAMAGED, FINISHED, UNFINISHED, RunFolder, find_run, run_folders
from tests.small_run import put, unfinish


def test_a_finished_run_has_its_facts(tmp_path):
    run = RunFolder.read(put(tmp_path / "a-1", fusion="mine", seed=3))
    assert (run.state, run.remark) == (FINISHED, "")
    assert run.parts == {
        "data.shapes": "cad-parts", "model.encoder": "unet", "model.fusion": "mine#0123456789ab",
        "train.objective": "chamfer",
    }  # fmt: skip
    values = run.results.methods[0].values["cd"]
    assert run.means == {"cd": pytest.approx(1000 * sum(values) / len(values))}
    assert run.size == sum(path.stat().st_size for path in run.folder.iterdir())
    for key, value in (
        *(("name", "a-1"), ("seed", 3), ("fusion", "mine"), ("model.encoder.channels", 8), ("version", "0.2.0")),
        *(("touch_encoder", None), ("nonsense.x", None), ("train.epochs", 2), ("state", FINISHED)),
    ):
        assert run.value(key) == value
    assert run.matches("name", "a-*")
    assert not run.matches("fusion", "min")


def test_age_is_that_of_the_newest_file(tmp_path):
    folder = put(tmp_path / "a")
    for path in folder.iterdir():
        os.utime(path, (1000, 1000))
    os.utime(folder / "metrics.jsonl", (3000, 3000))
    (folder / "report.html").touch()
    assert RunFolder.read(folder).changed == 3000, "the report may be made again"


@pytest.mark.parametrize(
    ("break_it", "state", "remark"),
    [
        (lambda folder: unfinish(folder), UNFINISHED, "training stopped after step 8"),
        (lambda folder: (unfinish(folder) / "weights.safetensors").touch(), UNFINISHED, "trained, not evaluated"),
        (lambda folder: (unfinish(folder) / "metrics.jsonl").unlink(), UNFINISHED, "training has not begun"),
        (lambda folder: (unfinish(folder) / "metrics.jsonl").write_text('{"step": 1, "loss": 1}\n{"st'), UNFINISHED,
         "training stopped after step 1"),
        (lambda folder: (folder / "results.json").write_text("{"), DAMAGED, "results.json:1"),
        (lambda folder: (unfinish(folder) / "recipe.json").write_text("[]"), DAMAGED, "not a JSON object"),
        (lambda folder: (folder / "results.json").write_text("1" * 5000), DAMAGED, "a number has too many digits"),
        (lambda folder: (unfinish(folder) / "recipe.json").write_text("[" * 99_999), DAMAGED, "nested too deeply"),
        (lambda folder: (folder / "examples.safetensors").unlink(), DAMAGED, "examples.safetensors is missing"),
    ],
)  # fmt: skip
def test_other_states_are_described(tmp_path, break_it, state, remark):
    break_it(put(tmp_path / "a"))
    run = RunFolder.read(tmp_path / "a")
    assert run.state == state
    assert remark in run.remark


def test_only_run_folders_are_listed_in_the_order_of_their_names(tmp_path):
    for name in ("b", "a", "c"):
        put(tmp_path / name)
    (tmp_path / "data").mkdir()
    (tmp_path / "compare.html").touch()
    assert [run.folder.name for run in run_folders(tmp_path)] == ["a", "b", "c"]
    with pytest.raises(UserError, match="data is no run folder"):
        RunFolder.read(tmp_path / "data")
    with pytest.raises(UserError, match=r"nowhere, cannot be read: No such file or directory; name it with --runs"):
        run_folders(tmp_path / "nowhere")


def test_a_run_is_found_by_path_name_and_beginning(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runs = tmp_path / "runs"
    for name in ("smoke-1a", "smoke-2b"):
        put(runs / name)
    for named in (runs / "smoke-1a", "smoke-1a", "smoke-1"):
        assert find_run(Path(named), runs) == runs / "smoke-1a"
    with pytest.raises(UserError, match="2 runs begin with 'smoke', such as smoke-1a and smoke-2b: name one"):
        find_run(Path("smoke"), runs)
    with pytest.raises(UserError, match=r"there is no run 'smok-1a'.*did you mean 'smoke-1a'\?"):
        find_run(Path("smok-1a"), runs)
