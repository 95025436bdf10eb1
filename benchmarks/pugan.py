"""PU-GAN's test shapes: 4x from 2048 points and 16x from 512, beside interpolation (the table of docs/upsample.md).

python benchmarks/pugan.py pugan21.npz [WEIGHTS…]

The file holds, for each shape, `input_512`, `input_2048` and `gt_8192` (independent Poisson-disk samples) and the mesh.
Clouds are compared as the field does it: each fills the unit sphere by itself; p2f is in the mesh's unit. Weights files
that are named are measured instead of the default ones, beside interpolation: by the field's protocol of patches
where their recipe has `patches`, otherwise as any cloud is upsampled.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from rich.console import Console
from rich.progress import track
from rich.table import Table

import pcsr
from pcsr.geometry.interpolation import midpoint
from pcsr.upsample import upsample_as

METRICS = ("cd", "hd-pugcn", "p2f")
Cloud = Float[np.ndarray, "n 3"]


def methods(rate: int, files: Sequence[Path]) -> dict[str, Callable[[Cloud], Cloud]]:
    """What is compared."""
    whole = {"midpoint, whole": lambda points: midpoint(points, rate, passes=2 if rate == 16 else 1)}
    if files:
        return {**whole, **{model.name: by_protocol(model, rate) for model in map(pcsr.load, files)}}
    network = pcsr.load()
    fan = pcsr.load()
    last = fan.network.upsampler.mlp[2]  # without its last layer the network is where it started from
    torch.nn.init.zeros_(last.weight)
    torch.nn.init.zeros_(last.bias)
    return {
        **whole,
        "midpoint, patches": lambda points: pcsr.load("midpoint").upsample(points, rate=rate),
        "fan, patches": lambda points: fan.upsample(points, rate=rate),
        "tapsr, patches": lambda points: network.upsample(points, rate=rate),
    }


def by_protocol(model: pcsr.Model, rate: int) -> Callable[[Cloud], Cloud]:
    """How a model is applied in the field's tables."""
    network, recipe = model.network, model.recipe
    if network is None or recipe is None or recipe.patches is None:
        return lambda points: model.upsample(points, rate=rate)
    recipe = recipe.model_copy(update={"data": recipe.data.model_copy(update={"rate": rate})})
    return lambda points: upsample_as(recipe, network, points)


def main(path: Path, *files: Path) -> None:
    """Print the table."""
    data = np.load(path)
    names = [str(name) for name in data["names"]]
    for rate, sparse in ((4, "input_2048"), (16, "input_512")):
        table = Table("method", *(f"{name} ×10³" for name in METRICS), title=f"{rate}x, {len(names)} shapes")
        for method, upsample in methods(rate, files).items():
            rows = []
            for k, name in enumerate(track(names, method, console=Console(stderr=True), transient=True)):
                mesh = data[f"vertices_{name}"], data[f"faces_{name}"]
                dense = upsample(data[sparse][k].astype(np.float64))
                values = pcsr.evaluate(dense, data["gt_8192"][k], mesh, frame="each", metrics=METRICS)
                rows.append([1e3 * values[metric] for metric in METRICS])
            mean, spread = np.mean(rows, 0), np.std(rows, 0, ddof=1)
            table.add_row(method, *(f"{m:.3f} ± {s:.3f}" for m, s in zip(mean, spread, strict=True)))
        Console().print(table)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
