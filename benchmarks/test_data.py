"""The builder: time and memory of 200 objects, and what that makes of the paper's 12,732 (TAPSR, Sec. 4.1).

make bench ARGS=benchmarks/test_data.py
"""

import sys
from pathlib import Path

import pytest
from processes import run

OBJECTS, PAPER = 200, 12_732


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("jobs", [1, 2])
def test_build(benchmark, tmp_path, jobs):
    command = [
        sys.executable, "-m", "pcsr.cli", "data", "make", "cad-parts", "-o", str(tmp_path / "data"),
        "--jobs", str(jobs), "--set", f"count={OBJECTS}", "--set", "held_out=0",
    ]  # fmt: skip
    seconds, peak = benchmark.pedantic(run, (command,), rounds=1)
    size = sum(path.stat().st_size for path in (tmp_path / "data").iterdir())
    benchmark.extra_info["seconds an object"] = round(seconds / OBJECTS, 3)
    benchmark.extra_info["peak MB"] = round(peak / 1e6)
    benchmark.extra_info["hours for the paper's objects"] = round(seconds / OBJECTS * PAPER / 3600, 2)
    benchmark.extra_info["GB for the paper's objects"] = round(size / OBJECTS * PAPER / 1e9, 2)
