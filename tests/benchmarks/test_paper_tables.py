"""benchmarks/paper_tables.py: which runs count, and what the tables say of them."""

import importlib
import json
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.run_files import FinishedRun
from tests.small_run import put, unfinish

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    tables = importlib.import_module("paper_tables")
    study_runs = importlib.import_module("study_runs")


def change(folder, **results):
    path = folder / "results.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | results))
    return folder


def put_row(runs, name, **given):
    """Write the run folder of a study's row, by the fingerprint of its recipe."""
    (recipe,) = [one for one in study_runs.recipes(name.partition("-")[0]) if one.name == name]
    return put(runs / f"{name}-{recipe.fingerprint[:8]}", name, **given)


def effect(touched, plain, replaced):
    """Of touch on eight objects."""
    each = {"touched": [touched] * 8, "plain": [plain] * 8, "replaced": [replaced] * 8}
    return {**each, "seconds": 0.1, "edges": [0.0], "counts": [1], "errors": {}}


def published(folder, **values):
    path = folder / "results.json"
    found = json.loads(path.read_text())
    found["recipe"]["evaluate"] = {"published": values}
    path.write_text(json.dumps(found))


@pytest.fixture
def runs(tmp_path):
    return tmp_path / "runs"


def of_other_fusion(alone, touched, registry):
    """Stands in for the measurement of a network alone with the touched points inserted."""
    model = {"model": {"fusion": {"use": "joint-cloud"}}}
    changed = {"name": "inserted", "recipe": alone.results.recipe | model, "touch": touched.results.touch}
    return FinishedRun(alone.folder, alone.results.model_copy(update=changed), [], alone.history)


def test_table_2_has_the_finished_rows_in_the_order_of_the_recipe(runs, monkeypatch):
    monkeypatch.setattr(tables, "inserted", of_other_fusion)
    tapsr = put_row(runs, "table2-tapsr", fusion="iterative")
    put_row(runs, "table2-pu-gcn-touch-edge-conv", fusion="edge-conv")
    fused = put_row(runs, "table2-pu-gcn-touch", fusion="iterative")
    alone = put_row(runs, "table2-pu-gcn")
    (alone / "inserted.json").touch()
    unfinish(put_row(runs, "table2-mpu"))
    put(runs / "other-00000006", "other")
    change(fused, touch=effect(0.9, 1.0, 0.6) | {"exchanged": [0.95] * 8})
    published(tapsr, cd=0.671)
    columns, lines = tables.table2(tables.finished(runs, "table2"))
    assert [line[:2] for line in lines] == [
        ["pu-gcn", "–"],
        ["pu-gcn", "inserted afterwards"],
        ["pu-gcn", "the paper's fusion"],
        ["pu-gcn", "points kept"],
        ["tapsr", "the paper's fusion"],
        ["midpoint", ""],
    ]
    shares = [line[columns.index("touch efficiency")] for line in lines]
    assert shares == ["–", "–", "0.250", "–", "–", ""]
    assert [line[columns.index("cd without touch")] for line in lines] == ["", "", "1000.000", "", "", ""]
    assert lines[2][columns.index("with another object's")] == "950.000"
    assert {len(line) for line in lines} == {len(columns)}
    assert lines[4][columns.index("cd")].endswith("(0.671)")
    values = json.loads((alone / "results.json").read_text())["methods"][0]["values"]["cd"]
    assert lines[0][columns.index("cd")].startswith(f"{1e3 * sum(values) / 8:.3f} ± ")


def test_runs_of_a_row_with_other_settings_are_left_out_and_named(runs, capsys):
    folder = put_row(runs, "table2-mpu")
    put(runs / "table2-mpu-00000002", "table2-mpu")
    (found,) = tables.finished(runs, "table2").values()
    assert [run.folder for run in found] == [folder]
    assert "table2-mpu-00000002: left out, as its settings are not those of table2" in capsys.readouterr().err


def test_the_last_quarter_is_the_change_of_the_validation_error(runs):
    folder = put_row(runs, "table2-mpu")
    errors = [8, 7, 6, 5, 4, 4, 4, 3]
    lines = [{"epoch": 1, "step": 10 * k, "validation": {"cd": error}} for k, error in enumerate(errors, 1)]
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    (run,) = tables.finished(runs, "table2")["mpu"]
    assert tables.last_quarter(run) == "-25.0 %"
    (folder / "metrics.jsonl").unlink()
    (run,) = tables.finished(runs, "table2")["mpu"]
    assert tables.last_quarter(run) == ""


def of_table4(runs, row, touches, factor, seeds=(0, 1)):
    for seed in seeds:
        name = f"table4-{row}-touches.{touches}-seed.{seed}"
        put_row(runs, name, seed=seed, factor=factor, touches=touches, row=row)


def test_table_4_has_a_column_for_each_number_of_touches(runs):
    of_table4(runs, "tapsr", 0, 1.0)
    of_table4(runs, "tapsr", 4, 0.5)
    of_table4(runs, "pu-transformer", 0, 2.0)
    columns, lines = tables.table4(tables.finished(runs, "table4"))
    assert [line[0] for line in lines] == ["PU-Transformer alone", "TAPSR: FE and FF blocks"]
    alone, tapsr = ([line[1 + count] for count in range(6)] for line in lines)
    assert [bool(text) for text in alone] == [True, False, False, False, False, False]
    assert [bool(text) for text in tapsr] == [True, False, False, False, True, False]
    assert float(tapsr[4].split()[0]) == pytest.approx(float(tapsr[0].split()[0]) / 2, rel=0.01)
    assert len(columns) == len(lines[0])


def test_differences_are_of_the_control(runs):
    of_table4(runs, "tapsr", 0, 3.0)
    of_table4(runs, "tapsr", 4, 0.5)
    of_table4(runs, "pu-transformer", 0, 2.0)
    assert [line[-1] for line in tables.table4(tables.finished(runs, "table4"))[1]] == ["", ""]
    of_table4(runs, "control", 0, 1.0)
    alone, control, tapsr = [line[-1] for line in tables.table4(tables.finished(runs, "table4"))[1]]
    assert control == ""
    for text, percent in ((alone, 100), (tapsr, -50)):
        mean, low, high = re.fullmatch(r"(\S+) % \[(\S+), (\S+)\], p = 0.0[1-9]", text).groups()
        assert float(low) < float(mean) < float(high)
        assert float(mean) == pytest.approx(percent, abs=2)


def test_grafts_are_compared_with_the_same_network_alone(runs):
    for name, fusion, factor in (
        ("mpu", "none", 1.0),
        ("mpu-touch", "iterative", 1.2),
        ("pu-gcn-touch", "iterative", 0.1),
        ("pu-transformer", "none", 1.0),
        ("tapsr", "iterative", 2.0),
    ):
        put_row(runs, f"table2-{name}", fusion=fusion, factor=factor)
    columns, lines = tables.table2(tables.finished(runs, "table2"))
    cells = [line[columns.index("cd against the network alone")].partition(" ")[0] for line in lines]
    assert cells == ["", "+20.0", "", "", "+100.0", ""]


def test_table_5_has_the_time_of_an_epoch_and_of_a_cloud(runs):
    for count in range(2):
        name = f"table5-tapsr-touches.{count}"
        folder = put_row(runs, name, touches=count)
        published(folder, **{"s/epoch": 76.68, "s/cloud": 0.0158})
        found = json.loads((folder / "results.json").read_text())
        change(folder, data=found["data"] | {"touches": count})
    columns, lines = tables.table5(tables.finished(runs, "table5"))
    assert columns == ["touches", "0", "1"]
    assert lines == [["s/epoch", *["0.5 (76.68)"] * 2], ["ms/cloud", *["100 (15.8)"] * 2]]


def test_the_command_prints_what_is_finished_and_names_what_is_not(runs):
    put_row(runs, "table3-tapsr-rate.16")
    done = CliRunner().invoke(tables.main, [str(runs)])
    assert done.exit_code == 0, done.output
    assert "table-3" in done.output
    assert "table-2: left out, as its runs" in done.output


def test_table_3_has_a_row_for_each_rate_with_its_own_baseline(runs):
    for rate, factor in ((16, 0.5), (8, 2.0)):
        put_row(runs, f"table3-tapsr-rate.{rate}", factor=factor, rate=rate)
        _, lines = tables.table3(tables.finished(runs, "table3"))
        assert [line[3] == "–" for line in lines] == [False] * len(lines)
        assert float(lines[0][2].split()[0]) == pytest.approx(float(lines[0][3].split()[0]) * factor, rel=0.01)
    assert [line[:2] for line in lines] == [["8", "–"], ["16", "–"]]


def test_results_that_are_kept_are_in_the_tables_with_those_of_later_runs(runs, tmp_path, monkeypatch):
    for module in (tables, study_runs):
        monkeypatch.setattr(module, "KEPT", tmp_path / "kept")
    saved = {}
    monkeypatch.setattr(tables, "save", lambda name, command, columns, rows: saved.update({name: rows}))
    validation = {"epoch": 1, "step": 8, "validation": {"cd": 0.1}}
    for name, fusion in (("mpu", "none"), ("mpu-touch", "iterative")):
        folder = put_row(runs, f"table2-{name}", fusion=fusion)
        with (folder / "metrics.jsonl").open("a") as history:
            history.write(json.dumps(validation) + "\n")
        done = CliRunner().invoke(tables.main, [str(runs), "--save"])
        assert done.exit_code == 0, done.output
        shutil.rmtree(folder)
    assert [row[:2] for row in saved["table-2"]] == [["mpu", "–"], ["mpu", "the paper's fusion"], ["midpoint", ""]]
    (kept,) = tables.finished(tmp_path / "kept", "table2")["mpu"]
    assert kept.history == [validation]
    assert {path.name for path in kept.folder.iterdir()} == {"results.json", "metrics.jsonl"}
    (kept.folder / "metrics.jsonl").unlink()
    assert tables.content(tables.finished(tmp_path / "kept", "table2")["mpu"][0]).keys() == {"results.json"}


def test_a_network_of_which_neither_weights_nor_numbers_were_kept_has_no_line_of_inserted_touches(runs):
    for name, fusion in (("mpu", "none"), ("mpu-touch-edge-conv", "edge-conv")):
        put_row(runs, f"table2-{name}", fusion=fusion)
    _, lines = tables.table2(tables.finished(runs, "table2"))
    assert [line[:2] for line in lines] == [["mpu", "–"], ["mpu", "points kept"], ["midpoint", ""]]


def test_without_finished_runs_the_command_says_what_makes_some(tmp_path):
    done = CliRunner().invoke(tables.main, [str(tmp_path)])
    assert done.exit_code == 1
    assert "holds no finished run of Tables 2 to 5: `pcsr run table2 --runs" in done.output
