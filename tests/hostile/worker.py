"""A process that runs `pcsr` commands one after another, each line of its input one command, with bounded memory.

It imports what is slow to import once, so that the seconds of a command are those that its input costs.
"""

import importlib
import io
import json
import os
import resource
import sys
import time
from pathlib import Path

ADDRESSES = 16 << 30
"""Bytes of address space: far more than any command needs, and an end to one that has none of its own."""


def resident(name):
    """Kilobytes of this process in memory: `VmRSS` now, `VmHWM` at most since `forget_peak`."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name))


def forget_peak():
    Path("/proc/self/clear_refs").write_text("5")


def run(arguments, given):
    from pcsr.cli import main

    streams = sys.stdin, sys.stdout, sys.stderr
    out, err = io.BytesIO(), io.BytesIO()
    sys.stdin = io.TextIOWrapper(io.BytesIO(bytes.fromhex(given)))
    sys.stdout, sys.stderr = (io.TextIOWrapper(one, encoding="utf-8", write_through=True) for one in (out, err))
    forget_peak()
    before, start, code = resident("VmRSS"), time.perf_counter(), 0
    try:
        main(arguments)
    except SystemExit as left:
        code = left.code or 0
    seconds = time.perf_counter() - start
    said = out.getvalue().decode(), err.getvalue().decode()
    sys.stdin, sys.stdout, sys.stderr = streams
    return {
        "code": code,
        "out": said[0],
        "err": said[1],
        "seconds": seconds,
        "megabytes": (resident("VmHWM") - before) / 1024,
    }


if __name__ == "__main__":
    for slow in ("pcsr.model", "pcsr.recipe", "rich.console", "click"):
        importlib.import_module(slow)

    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    answers = os.fdopen(int(sys.argv[1]), "w")
    for line in sys.stdin:
        asked = json.loads(line)
        os.chdir(asked["folder"])
        answers.write(json.dumps(run(asked["arguments"], asked["stdin"])) + "\n")
        answers.flush()
