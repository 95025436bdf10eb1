"""benchmarks/saved.py and pretrained.py: tables of made-up results, as pages include them."""

import importlib
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    saved, script = map(importlib.import_module, ("saved", "pretrained"))


@pytest.fixture
def runs(tmp_path):
    """One run of each network, on two objects."""
    for name in script.NETWORKS:
        beside = [{"name": "midpoint", "values": {"cd": [0.003, 0.005], "hd": [0.1, 0.3]}}]
        effect = {"touched": [0.001, 0.002], "plain": [0.002, 0.004], "replaced": [0.001, 0.001]}
        results = {
            "metrics": {"cd": {"scale": 1000}, "hd": {"scale": 1000}},
            "methods": [{"name": name, "values": {"cd": [0.001, 0.002], "hd": [0.1, 0.2]}}, *beside],
            "touch": None if name == "pu-transformer" else effect,
        }
        folder = tmp_path / f"pretrained-{name}-0123abcd"
        folder.mkdir()
        (folder / "results.json").write_text(json.dumps(results), encoding="utf-8")
    return tmp_path


def test_the_table_is_written_as_pages_include_it(runs, monkeypatch, tmp_path):
    monkeypatch.setattr(saved, "NUMBERS", tmp_path)
    result = CliRunner().invoke(script.main, [str(runs), "--save"])
    assert result.exit_code == 0, result.output
    written = json.loads((tmp_path / "pretrained.json").read_text(encoding="utf-8"))
    shown = json.loads((ROOT / "docs" / "numbers" / "pretrained.json").read_text(encoding="utf-8"))
    assert written.keys() == shown.keys()
    assert written["command"] == shown["command"]
    assert written["columns"] == ["method", "cd", "hd", "touch efficiency"]
    assert written["rows"][0] == ["`field`", "1.500 ± 0.707", "150.0 ± 70.7", "0.75"]
    assert [row[-1] for row in written["rows"][1:]] == ["0.75", "0.75", "–", ""]


def test_a_run_that_is_missing_is_named(runs, tmp_path):
    (tmp_path / "pretrained-tapsr-0123abcd" / "results.json").unlink()
    result = CliRunner().invoke(script.main, [str(runs)])
    assert result.exit_code == 1
    assert "must hold one run of each of field, frames, tapsr, pu-transformer: `make run` makes them" in result.output
