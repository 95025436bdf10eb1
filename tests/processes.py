"""Processes that are killed, and those that they leave behind."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[1]


def alive(process):
    """Whether a process is there, and not only its entry in the table, which init may be slow to take away."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(process)], capture_output=True, text=True).stdout.strip()
    return bool(state) and not state.startswith("Z")


def wait_for(condition, seconds):
    """Whether a condition is met before so many seconds are over."""
    end = time.monotonic() + seconds
    while not (met := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return met


@contextmanager
def killed_while(script, argument, folder, ready):
    """Kill a script with -9 as soon as `ready` files NAME.ready lie in the folder that it runs in.

    Gives the processes that wrote a file named after their id, and the shared files in memory.
    """
    (folder / "parent.py").write_text(script)
    path = os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
    parent = subprocess.Popen(
        [sys.executable, "parent.py", argument], cwd=folder, env={**os.environ, "PYTHONPATH": path}
    )
    workers = []
    try:
        assert wait_for(lambda: len(list(folder.glob("*.ready"))) >= ready, 60)
        maps = Path(f"/proc/{parent.pid}/maps")
        shared = set(re.findall(r"/dev/shm/\S+", maps.read_text())) if maps.exists() else set()
        workers = [int(path.stem) for path in folder.glob("*.ready") if path.stem.isdecimal()]
        parent.kill()
        parent.wait()
        yield workers, shared
    finally:
        parent.kill()
        for worker in filter(alive, workers):
            os.kill(worker, signal.SIGKILL)
