"""docs/sensors.md: its code and its commands work from top to bottom, and print the tables that it shows."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.clouds.formats import read_points

TEXT = (Path(__file__).parents[2] / "docs" / "sensors.md").read_text(encoding="utf-8")
CODE = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
COMMANDS = re.findall(r"^pcsr (.*touches/.*)$", TEXT, re.MULTILINE)
HEADS = [line.split() for line in TEXT.splitlines() if line.startswith(("mm     presses", "image   "))]


@pytest.mark.slow
def test_the_page_works_from_top_to_bottom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made, read = CODE
    exec(made, {})
    assert [line.split()[0] for line in COMMANDS] == ["sensor", "sensor", "recorded", "upsample"]
    printed = ""
    for line in COMMANDS:
        done = CliRunner().invoke(pcsr, shlex.split(line))
        assert done.exit_code == 0, done.output
        printed += done.stdout
    exec(read, {})
    shown = [line.split() for line in printed.splitlines()]
    assert len(HEADS) == 4
    assert all(head in shown for head in HEADS)
    assert {"mine.html", "seen/0.png", "points/3.ply"} <= {
        path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")
    }
    dense = read_points(Path("dense.ply"))
    low = dense[dense[:, 2] < -4]
    assert len(low) > 100
    assert np.abs(np.linalg.norm(low, axis=1) - 10).max() < 0.2
