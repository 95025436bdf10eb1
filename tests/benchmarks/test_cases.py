"""benchmarks/cases.py: small inputs with troubles, and what the commands make of them."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script, checks = importlib.import_module("cases"), importlib.import_module("case_checks")

README = """
| file | trouble | now | must |
|---|---|---|---|
| `sentinel.xyz`, `upper.pcd` | several | wrong | right |
| `scan.asc` beside `ev_b.xyz` | several | wrong | `right` |
| `unknown.xyz` | none | wrong | right |
"""


@pytest.mark.slow
def test_each_file_of_the_table_has_a_row_with_its_verdict(tmp_path):
    points = np.random.default_rng(0).uniform(-1, 1, (400, 3)) * [1, 1, 0.1]
    np.savetxt(tmp_path / "xyzrgb.txt", np.c_[points, points])
    np.savetxt(tmp_path / "sentinel.xyz", np.r_[points, [[1e10] * 3]])
    (tmp_path / "upper.pcd").write_text("not a cloud\n")
    (tmp_path / "README.md").write_text(README)
    done = CliRunner().invoke(script.main, [str(tmp_path), "--model", "midpoint"])
    assert done.exit_code == 1
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done.stdout.splitlines() if "│" in line]
    verdicts = {name: (must, ok) for name, must, _, ok in rows if name}
    assert verdicts == {
        "sentinel.xyz": ("right", "ok"),
        "upper.pcd": ("right", "NOT OK"),
        "scan.asc": ("`right`", "NOT OK"),
        "unknown.xyz": ("right", "NOT OK"),
    }
    assert "1 of 401 points" in re.sub(r"\s+", " ", done.stdout)
    assert "1 of 4 files are ok" in done.stdout


def test_a_cloud_that_is_misread_is_not_ok(tmp_path):
    columns = np.arange(120.0).reshape(20, 6)
    np.savetxt(tmp_path / "xyzrgb.txt", columns)
    np.savetxt(tmp_path / "scan.xyz", columns[:, 1:4])
    good, what = checks.read(checks.Case(tmp_path / "scan.xyz", tmp_path, "midpoint"))
    assert not good
    assert what.startswith("misread: begins with [1.0, 2.0, 3.0], not [0.0, 1.0, 2.0]")
