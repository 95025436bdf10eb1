"""docs/install.md: its table is pyproject.toml's, and completion works as it says."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pcsr.extras import PACKAGES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


def test_every_extra_is_in_the_table(project):
    rows = dict(re.findall(r"^\| `([a-z0-9]+)` \| [^|]+ \| ([^|]*) \|", PAGE, re.MULTILINE))
    assert rows.keys() == project["optional-dependencies"].keys()
    for package in PACKAGES.values():
        assert package.title in rows[package.extra].lower()


def test_what_the_readme_and_the_makefile_install_is_there(project):
    extras = project["optional-dependencies"].keys()
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (of_make,) = re.findall(r"^EXTRAS := (.*)$", makefile, re.MULTILINE)
    assert extras - set(of_make.split(",")) == {"all", "hub", "open3d"}
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    named = [name for page in pages for name in re.findall(r"pcsr\[([a-z0-9,]+)\]", page.read_text(encoding="utf-8"))]
    assert len(named) >= 4
    assert {extra for name in named for extra in name.split(",")} <= extras


@pytest.mark.parametrize("shell", re.findall(r"_PCSR_COMPLETE=(\w+)_source pcsr", PAGE))
def test_completion_is_offered_and_completes(shell):
    if shell == "bash" and shutil.which("bash") is None:
        pytest.skip("click asks bash for its version")

    def run(step, **words):
        environment = os.environ | {"_PCSR_COMPLETE": f"{shell}_{step}"} | words
        command = [sys.executable, "-m", "pcsr.cli"]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    assert "_PCSR_COMPLETE" in run("source")
    words = {"COMP_WORDS": "pcsr ups", "COMP_CWORD": "ups" if shell == "fish" else "1"}
    assert "upsample" in run("complete", **words)
