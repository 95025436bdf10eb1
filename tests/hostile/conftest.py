"""Commands on hostile input: each in a process whose seconds and memory are measured and bounded."""

import json
import os
import select
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

WORKER = Path(__file__).with_name("worker.py")
PATIENCE = 60.0
"""Seconds after which a command that goes on is stopped, and its test fails."""


@dataclass(frozen=True)
class Outcome:
    """What a command did."""

    code: int
    out: str
    err: str
    seconds: float
    megabytes: float
    """By which the process grew at its largest."""

    def refused(self, *words: str, code: int = 2, seconds: float = 10.0, megabytes: float = 300.0) -> None:
        """Assert that the command ended in one line that holds all `words`, soon and without much memory."""
        assert self.code == code, (self.code, self.out, self.err)
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert "--traceback" not in self.err, f"an error without a type of its own: {self.err}"
        for word in words:
            assert word in self.err, self.err
        assert self.seconds < seconds
        assert self.megabytes < megabytes


class Limited:
    """Runs commands in one process after another: a new one whenever the last was stopped."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        read, write = os.pipe()
        self.process = subprocess.Popen(
            [sys.executable, WORKER, str(write)],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=(write,),
            text=True,
        )
        os.close(write)
        self.answers = os.fdopen(read)

    def stop(self) -> str:
        """End the process; what it said last."""
        if self.process is None:
            return ""
        self.process.kill()
        said = self.process.communicate()[1]
        self.answers.close()
        self.process = None
        return said

    def __call__(self, *arguments: object, folder: Path, stdin: bytes = b"", seconds: float = PATIENCE) -> Outcome:
        if self.process is None:
            self.start()
        assert self.process is not None
        assert self.process.stdin is not None
        asked = {"arguments": [str(one) for one in arguments], "folder": str(folder), "stdin": stdin.hex()}
        self.process.stdin.write(json.dumps(asked) + "\n")
        self.process.stdin.flush()
        # A new process imports torch first, which on a busy machine takes long.
        ready = select.select([self.answers], [], [], seconds + 30)[0]
        line = self.answers.readline() if ready else ""
        if not line:
            said = self.stop()
            pytest.fail(f"pcsr {' '.join(asked['arguments'])} {'died: ' + said if ready else 'went on and on'}")
        return Outcome(**json.loads(line))


@pytest.fixture(scope="module")
def limited(tmp_path_factory):
    """`limited("upsample", "in.xyz", …, folder=tmp_path)` runs a command; see `Outcome.refused`."""
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("memory is measured by way of /proc, which this system lacks")
    runner = Limited()
    yield runner
    runner.stop()
