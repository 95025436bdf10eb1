"""The training loop: what it adds to the network's own work, and whether two processes beat one.

make bench ARGS=benchmarks/test_training.py
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from lightning_fabric import Fabric
from training import BATCH, recipe, split

from pcsr.data.batches import Batches
from pcsr.experiments.optimization import optimizer_of
from pcsr.experiments.train import _step, _Training
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins

STEP, ASKED = "training loop: a step of 8 objects with 4 touches", "network ≥ 85 %: ≤ 1.18 × the limit"
CORES, STEPS = "training on two cores: one process of 2 threads; usual: two of 1", 12


@pytest.fixture
def parts():
    made, registry = recipe(), load_plugins()
    network = build(made, registry)
    model = _Training(network, made.train.objective.build(registry, "objective"))
    batches = Batches(split(2 * BATCH), BATCH, made.touch_range, made.train.augment, made.seed)
    return made, network, model, optimizer_of(made.train, network, model.objective), batches


def test_step(benchmark, line, parts):
    """All of it: the batch drawn and augmented, the network, the loss, Adam."""
    line(STEP, "ours", ASKED)
    made, _, model, optimizer, batches = parts
    fabric = Fabric(accelerator="cpu", devices=1)
    wrapped, optimizer = fabric.setup(model, optimizer)
    steps = iter(range(1000))
    benchmark.pedantic(
        lambda: _step(wrapped, optimizer, fabric, batches.at(next(steps)), made),
        rounds=10,
        warmup_rounds=1,
    )


def test_network_alone(benchmark, line, parts):
    """Forward, backward and Adam."""
    line(STEP, "limit")
    made, network, _, optimizer, batches = parts
    batch = batches.at(0)

    def alone():
        dense = network(batch.points, made.data.rate, batch.touches)
        optimizer.zero_grad()
        (dense * batch.truth).mean().backward()
        optimizer.step()

    benchmark.pedantic(alone, rounds=10, warmup_rounds=1)


@pytest.mark.skipif((os.cpu_count() or 1) < 2 or torch.get_num_threads() < 2, reason="one core")
@pytest.mark.parametrize(("role", "processes"), [("ours", 1), ("usual", 2)])
def test_two_cores(benchmark, line, role, processes):
    """The same global batch; start-up is in the times, not in what is said of a step."""
    line(CORES, role)
    script = [str(Path(__file__).with_name("training.py")), str(STEPS)]
    torchrun = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(processes)]
    command = [sys.executable, *(torchrun if processes > 1 else []), *script]
    environment = os.environ | {"OMP_NUM_THREADS": str(2 // processes)}

    def run():
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
        return float(done.stdout.split()[-1])

    seconds = benchmark.pedantic(run, rounds=1)
    benchmark.extra_info["says"] = f"{processes} × {2 // processes} threads: {seconds:.2f} s a step"
