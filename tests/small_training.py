"""A training of four epochs of two batches, over in a moment."""

import json
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric

from pcsr.data.dataset import Split
from pcsr.experiments.recorder import Progress
from pcsr.experiments.train import train
from pcsr.geometry.frames import UnitSphere
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe, load
from pcsr.run_files import HISTORY

SMOKE = Path(__file__).parents[1] / "pcsr/recipes/smoke.yaml"
TINY = f"""\
extends: {SMOKE.as_posix()}
name: tiny
data: {{touches: 1, points: 24, touch: {{points: 16}}}}
model:
  encoder: {{channels: 8}}
  touch_encoder: {{channels: 4}}
  backbone: {{channels: [8], neighbours: 4}}
  upsampler: {{use: shuffle, hidden: 8, start: origin}}
train: {{epochs: 4, batch: 3, touches: [0, 2]}}
"""
STEPS = 8
"""Four epochs of two batches."""


def tiny(folder: Path, *overrides: str, more: str = "") -> Recipe:
    (folder / "tiny.yaml").write_text(TINY + more)
    (only,) = load(folder / "tiny.yaml", load_plugins(), overrides)
    return only


def varied(recipe: Recipe) -> Network:
    """A network whose features and touches have an effect: its last layer does not begin at zero."""
    made = build(recipe, load_plugins()).eval()
    with torch.no_grad():
        made.upsampler.mlp[-1].weight.normal_()
    return made


def split(count: int, seed: int) -> Split:
    random = torch.Generator().manual_seed(seed)
    truth = torch.randn(count, 96, 3, generator=random)
    truth = truth / truth.norm(dim=-1, keepdim=True)
    return Split(
        names=[f"object {i}" for i in range(count)],
        groups=["all"] * count,
        truth=list(truth),
        points=list(truth[:, ::4].clone()),
        touches=list(truth[:, :32].reshape(count, 2, 16, 3).clone()),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * count,
        covered=[(0.1, 0.2)] * count,
        about={},
    )


def trained(recipe: Recipe, run: Path, **options) -> Network:
    run.mkdir(exist_ok=True)
    fabric = Fabric(accelerator="cpu", devices=1)
    registry = options.pop("registry", load_plugins())
    return train(recipe, registry, split(6, 1), split(2, 2), run, fabric, **options)[0]


def history(run: Path) -> list[dict]:
    """The history without its times, which differ from run to run."""
    lines = [json.loads(line) for line in (run / HISTORY).read_text().splitlines()]
    return [{key: value for key, value in line.items() if key != "seconds"} for line in lines]


def stop_at(step: int):
    def shown(progress: Progress) -> None:
        if progress.step == step:
            raise KeyboardInterrupt

    return shown


def same(a: Network, b: Network) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a.parameters(), b.parameters(), strict=True))


def threads_of_steps(run: Path) -> set[int]:
    return {line["threads"] for line in history(run) if "loss" in line}
