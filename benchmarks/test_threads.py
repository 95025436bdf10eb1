"""How long work takes with the threads that pcsr gives it, on a quiet machine and beside busy processes.

make bench ARGS=benchmarks/test_threads.py

Usual is what torch does if it is left alone: all cores, waiting in a loop. The limit is the best of one thread, all
threads, and all threads that sleep while they wait. Times are medians of rounds in which all settings take turns.
"""

import os
import statistics
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

import pytest

from pcsr.threads import PASSIVE, WAIT_VARIABLES

ROUNDS, ROUNDS_BESIDE = 5, 3
BUSY = os.cpu_count() or 1
"""Processes that do nothing but compute: one for each core."""
WORK = {
    "upsample": "Model.upsample, 8,000 points",
    "inference": "TAPSR, ten clouds of 512",
    "tapsr": "TAPSR, two training steps of 8",
    "smoke": "smoke.yaml, the training",
}
SETTINGS = {
    "ours": ("as-pcsr", {}),
    "one thread": ("as-torch", {"OMP_NUM_THREADS": "1"}),
    "all": ("as-torch", {}),
    "all, passive": ("as-torch", PASSIVE),
}
ASKED = {"quiet": "usual ≥ 0.95 × ours", "busy": "≤ 1.3 × the limit"}


class Worker:
    """A process that does one kind of work each time a line is sent to it."""

    def __init__(self, work, how, environment):
        clean = {k: v for k, v in os.environ.items() if k not in (*WAIT_VARIABLES, "OMP_NUM_THREADS")}
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("threaded.py")), work, how],
            env=clean | environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout.readline() == "ready\n"

    def seconds(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


@contextmanager
def beside(count):
    """So many busy processes."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


@cache
def measured(work):
    """Of each load and setting the median seconds; all take turns."""
    found = {}
    with ExitStack() as stack:
        workers = {name: stack.enter_context(Worker(work, *setting)) for name, setting in SETTINGS.items()}
        for load, busy, rounds in (("quiet", 0, ROUNDS), ("busy", BUSY, ROUNDS_BESIDE)):
            with beside(busy):
                times = [[worker.seconds() for worker in workers.values()] for _ in range(rounds)]
            found[load] = dict(zip(workers, map(statistics.median, zip(*times, strict=True)), strict=True))
    return found


@pytest.mark.parametrize("role", ["ours", "usual", "limit"])
@pytest.mark.parametrize("load", ["quiet", "busy"])
@pytest.mark.parametrize("work", WORK)
def test_threads(benchmark, line, work, load, role):
    found = measured(work)[load]
    others = {name: seconds for name, seconds in found.items() if name != "ours"}
    best = min(others, key=others.__getitem__)
    where = "quiet" if load == "quiet" else f"beside {BUSY} busy processes"
    says = ", ".join(f"{name} {seconds:.3g}" for name, seconds in others.items()) if role == "limit" else ""
    line(f"{WORK[work]}, {where}", role, ASKED[load] if role == "ours" else "", says)
    benchmark.extra_info["seconds"] = {"ours": found["ours"], "usual": found["all"], "limit": others[best]}[role]
    benchmark.pedantic(lambda: None, rounds=1)  # it was measured in turns with the others
