"""A fresh virtual environment, into which distributions are installed as a person would, but without a network."""

import os
import shlex
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OFFLINE = ("--no-deps", "--no-build-isolation", "--no-index")


class Environment:
    """Commands as a person types them, run by the environment's own Python."""

    def __init__(self, folder: Path) -> None:
        self.python = str(folder / "bin" / "python")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        (site,) = folder.glob("lib/python*/site-packages")
        # What pcsr needs, hatchling too, and pcsr itself come from where the tests run.
        paths = (sysconfig.get_path("purelib"), sysconfig.get_path("platlib"))
        beside = dict.fromkeys([str(ROOT), str(ROOT / "plugins"), *paths])
        (site / "beside.pth").write_text("\n".join(beside) + "\n")

    def __call__(self, line: str, cwd: Path, code: int = 0) -> str:
        """Run a line and return what it prints; it must exit with `code`."""
        program, *arguments = shlex.split(line, comments=True)
        if program == "pip" and arguments[0] in ("install", "wheel"):
            arguments = [arguments[0], *OFFLINE, *arguments[1:]]
        if program == "pcsr" and arguments[0] in ("run", "compare"):
            arguments += ["--jobs", "1"]  # more processes take longer to start than they save
        module = {"pip": "pip", "pcsr": "pcsr.cli", "pytest": "pytest"}[program]
        done = subprocess.run(
            [self.python, "-m", module, *arguments],
            cwd=cwd,
            env={**os.environ, "COLUMNS": "200"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == code, f"{line}\n{done.stdout}"
        return done.stdout


@pytest.fixture(scope="session")
def environment(tmp_path_factory):
    return Environment(tmp_path_factory.mktemp("environment") / "venv")
