"""Memory of a command and of all that it starts (Linux: read from /proc)."""

import os
import subprocess
import threading
import time
from collections.abc import Sequence
from pathlib import Path


def memory(group: int) -> int:
    """Bytes that the processes of a group hold, what they share counted once."""
    held = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(folder.name)) == group:
                lines = (folder / "smaps_rollup").read_text().splitlines()
                held += 1024 * next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
        except (OSError, StopIteration):
            continue
    return held


def run(command: Sequence[str], every: float = 0.2) -> tuple[float, int]:
    """Seconds that a command takes, and the most bytes that it holds."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    peak, done = 0, threading.Event()

    def watch() -> None:
        nonlocal peak
        while not done.wait(every):
            peak = max(peak, memory(process.pid))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, command)
    finally:
        done.set()
        watcher.join()
    return time.perf_counter() - start, peak
