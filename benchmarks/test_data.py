"""The builder: time and memory of 200 objects, and what that makes of the paper's 12,732 (TAPSR, Sec. 4.1).

make bench ARGS=benchmarks/test_data.py
"""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

OBJECTS, PAPER = 200, 12_732


def memory(group: int) -> int:
    """Bytes that the processes of a group hold, what they share counted once (Linux)."""
    held = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(folder.name)) == group:
                line = next(line for line in (folder / "smaps_rollup").read_text().splitlines() if line[:4] == "Pss:")
                held += 1024 * int(line.split()[1])
        except (OSError, StopIteration):
            continue
    return held


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("jobs", [1, 2])
def test_build(benchmark, tmp_path, jobs):
    command = [
        sys.executable, "-m", "pcsr.cli", "data", "make", "cad-parts", "-o", str(tmp_path / "data"),
        "--jobs", str(jobs), "--set", f"count={OBJECTS}", "--set", "held_out=0",
    ]  # fmt: skip
    peak = 0

    def build():
        nonlocal peak
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
        done = threading.Event()

        def watch():
            nonlocal peak
            while not done.is_set():
                peak = max(peak, memory(process.pid))
                time.sleep(0.1)

        watcher = threading.Thread(target=watch)
        watcher.start()
        try:
            assert process.wait() == 0
        finally:
            done.set()
            watcher.join()

    benchmark.pedantic(build, rounds=1)
    seconds = benchmark.stats["mean"]
    size = sum(path.stat().st_size for path in (tmp_path / "data").iterdir())
    benchmark.extra_info["seconds an object"] = round(seconds / OBJECTS, 3)
    benchmark.extra_info["peak MB"] = round(peak / 1e6)
    benchmark.extra_info["hours for the paper's objects"] = round(seconds / OBJECTS * PAPER / 3600, 2)
    benchmark.extra_info["GB for the paper's objects"] = round(size / OBJECTS * PAPER / 1e9, 2)
