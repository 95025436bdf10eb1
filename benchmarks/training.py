"""Some steps of pcsr/recipes/tapsr.yaml on dented spheres instead of parts; prints the seconds of the fastest.

[torchrun --standalone --nproc-per-node 2] python benchmarks/training.py STEPS
"""

import itertools
import os
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric
from torch.nn import functional as F

from pcsr.data.dataset import Split
from pcsr.experiments.train import train
from pcsr.geometry.frames import UnitSphere
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe, load

RECIPE = Path(__file__).parents[1] / "pcsr/recipes" / "tapsr.yaml"
BATCH = 8


def recipe(*settings: str) -> Recipe:
    """TAPSR's, with four touches in each step."""
    (only,) = load(RECIPE, load_plugins(), [f"train.batch={BATCH}", "train.touches=4", *settings])
    return only


def split(count: int, points: int = 512, rate: int = 16, touch_points: int = 512) -> Split:
    """Dented spheres with four touches each."""
    generator = torch.Generator().manual_seed(0)
    truth = F.normalize(torch.randn(count, rate * points, 3, generator=generator), dim=-1)
    truth = truth * (0.8 + 0.2 * torch.sin(5 * truth[..., :1]))
    near = torch.cdist(truth[:, :4], truth).topk(touch_points, largest=False).indices
    return Split(
        names=[str(i) for i in range(count)],
        groups=["spheres"] * count,
        truth=list(truth),
        points=list(truth[:, ::rate]),
        touches=list(truth[torch.arange(count)[:, None, None], near]),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * count,
        covered=[(0.1, 0.2, 0.3, 0.4)] * count,
        about={},
    )


def main(steps: int) -> None:
    """Train as `pcsr run` does."""
    processes = int(os.environ.get("WORLD_SIZE", "1"))
    strategy = "ddp_find_unused_parameters_true" if processes > 1 else "auto"
    fabric = Fabric(accelerator="cpu", devices=processes, strategy=strategy)
    fabric.launch()
    ends: list[float] = []
    with tempfile.TemporaryDirectory() as run:
        train(
            recipe(f"train.epochs={steps}"),
            load_plugins(),
            split(BATCH),
            split(1),
            Path(run),
            fabric,
            shown=lambda progress: ends.append(progress.seconds),
        )
    if fabric.is_global_zero:
        print(min(b - a for a, b in itertools.pairwise(ends)))  # noqa: T201


if __name__ == "__main__":
    main(int(sys.argv[1]))
