"""Runs of `pcsr upsample` on a small input, for `case_checks.py`."""

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud

POSE = np.array([10, 20, 30])
"""Translation in the header of the PTX file."""


@dataclass(frozen=True)
class Outcome:
    """What a command did."""

    code: int
    said: str
    """Its remarks and errors, without progress and summary."""
    out: Path

    @property
    def refused(self) -> bool:
        """Whether the input was refused in one line and nothing was written."""
        return self.code == 2 and "\n" not in self.said and not self.out.exists()

    def cloud(self) -> Cloud:
        if self.code:
            raise click.ClickException(f"exit code {self.code}: {self.said}")
        return read_cloud(self.out, bad="keep")


@dataclass(frozen=True)
class Case:
    """A file, and a folder for results."""

    path: Path
    folder: Path
    model: str

    def upsample(self, *options: str, path: Path | None = None, suffix: str = ".ply") -> Outcome:
        """Run `pcsr upsample` on the file, or on another."""
        out = self.folder / f"out{suffix}"
        out.unlink(missing_ok=True)
        done = pcsr("upsample", str(path or self.path), "-o", str(out), "--model", self.model, *options)
        said = [
            line for line in done.stderr.splitlines() if line and not re.match(r"upsampling|\d+ points .* by ", line)
        ]
        return Outcome(done.returncode, "\n".join(said), out)

    def upsampled(self, points: np.ndarray) -> np.ndarray:
        """Upsample other points, and return all points of the result."""
        path = self.folder / "healthy.xyz"
        np.savetxt(path, points, fmt="%.17g")
        return self.upsample(path=path, suffix=".xyz").cloud().points

    def plain(self) -> np.ndarray:
        """Return the coordinates that most files hold."""
        points: np.ndarray = np.loadtxt(self.path.parent / "xyzrgb.txt")[:, :3]
        return points + POSE if self.path.suffix == ".ptx" else points


def pcsr(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run a command as a person does."""
    return subprocess.run([sys.executable, "-m", "pcsr.cli", *words], capture_output=True, text=True, check=False)
