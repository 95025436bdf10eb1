"""examples/cluster: a study on two workers of a Dask cluster has the bytes of one on this machine alone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from safetensors.torch import load_file

from pcsr.weights.file import read_card

ROOT = Path(__file__).parents[2]
STUDY = """\
extends: smoke
name: study
data: {shapes: {count: 4, held_out: 2}, points: 32, touches: 0}
model: {encoder: {channels: 8}, backbone: {channels: [8]}}
train: {epochs: 2, batch: 2, touches: 0}
evaluate: {metrics: [cd], examples: 0}
matrix:
  train.optimizer: [adam, {use: sgd, momentum: 0.9}]
"""


def runs(folder):
    """Weights, history without its times, and errors of each run."""
    found = {}
    for path in folder.glob("study-*/weights.safetensors"):
        lines = [json.loads(line) for line in (path.parent / "metrics.jsonl").read_text().splitlines()]
        history = [{key: value for key, value in line.items() if key != "seconds"} for line in lines]
        methods = json.loads((path.parent / "results.json").read_text())["methods"]
        tensors = {name: tensor.numpy().tobytes() for name, tensor in load_file(path).items()}
        errors = [method["values"] for method in methods]
        found[path.parent.name] = (read_card(path)["sha256"], tensors, history, errors)
    return found


@pytest.mark.dask
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_two_workers_have_the_bytes_of_one_machine(tmp_path):
    distributed = pytest.importorskip("distributed")
    study = tmp_path / "study.yaml"
    study.write_text(STUDY)
    here = [sys.executable, "-m", "pcsr.cli", "run", study, "--runs", tmp_path / "here", "--jobs", "1"]
    subprocess.run(here, check=True, capture_output=True)
    script = ROOT / "examples" / "cluster" / "dask_study.py"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        there = [sys.executable, script, cluster.scheduler_address, study, "--runs", tmp_path / "there"]
        done = subprocess.run(there, capture_output=True, text=True, check=False)
        elsewhere = [*there[:-1], tmp_path / "failed", "--set", "train.snapshots=[99]"]
        failed = subprocess.run(elsewhere, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "row 1 of 2 is finished" in done.stdout
    assert "row 2 of 2 is finished" in done.stdout
    assert "all runs: " in done.stdout
    assert failed.returncode == 1
    assert "ended with code 2: its message is in the worker's log" in failed.stderr
    assert len(runs(tmp_path / "here")) == 2
    assert runs(tmp_path / "there") == runs(tmp_path / "here")
