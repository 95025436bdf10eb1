"""How long one waits for a help page, and for a small cloud: interpreter, imports and all.

make bench ARGS=benchmarks/test_start.py
"""

import subprocess
import sys

import numpy as np
import pytest

HELP, SMALL = "pcsr --help", "pcsr upsample, 2,048 points by 4"


@pytest.fixture
def python(benchmark):
    """Measure what a fresh interpreter takes for these arguments."""

    def measure(*arguments):
        command = [sys.executable, *arguments]
        benchmark.pedantic(subprocess.run, (command,), {"check": True, "capture_output": True}, rounds=5)

    return measure


def test_help(line, python):
    line(HELP, "ours", "< 0.4 s")
    python("-m", "pcsr.cli", "--help")


def test_click_alone(line, python):
    line(HELP, "limit")
    python("-c", "import click")


def test_upsample(line, python, tmp_path):
    line(SMALL, "ours", "< 4 s")
    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(2048, 3))
    np.save(tmp_path / "ball.npy", cloud / np.linalg.norm(cloud, axis=1, keepdims=True))
    python("-m", "pcsr.cli", "upsample", str(tmp_path / "ball.npy"), "-o", str(tmp_path / "dense.ply"))


def test_torch_alone(line, python):
    line(SMALL, "limit")
    python("-c", "import torch")
