"""What each step of upsampling brings, on PU-GAN's test shapes: the default model, with one step taken away at a time.

python benchmarks/ablation.py pugan21.npz [--first 5] [--save]

Each row is `Model.upsample` without touches, as in benchmarks/pugan.py, with its metrics. The last two rows of a rate
are of other candidates: the weights that the default's training started from, and interpolation. Seconds are of the
processor, for all shapes of a rate.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import click
import numpy as np
from pugan import INPUTS, METRICS, SHIFTED, SPACING, Shape, read, scores
from rich.console import Console
from rich.progress import track
from saved import save, show

import pcsr
from pcsr.errors import PcsrError
from pcsr.upsample import candidates, dense, patch, selection
from pcsr.weights import DEFAULT
from pcsr_plugins.upsamplers.rated_edges import RatedEdges

COLUMNS = ("method", "rate", *METRICS, SHIFTED, SPACING, "seconds")


STEPS: dict[str, tuple[Any, str, Any]] = {
    "predicted errors in the choice": (selection, "CAUTION", 0.0),
    "corrected copies of generated points": (RatedEdges, "corrects_points", False),
    "shares by cells of a core": (patch, "CELL", 1 << 30),
    "shares by area": (dense, "weights", lambda cloud, plan: np.ones(len(cloud))),
    "patches of 1,024 points, but of 512": (candidates, "LOCAL_SIZE", 512),
}
"""What is replaced, in what, and by what, to take a step away."""


def row(name: str, model: pcsr.Model, shapes: Sequence[Shape], rate: int) -> list[str]:
    """Measure a model: the mean over the shapes."""
    found, seconds = [], 0.0
    for shape in track(shapes, f"{name}, {rate}x", console=Console(stderr=True), transient=True):
        start = time.process_time()
        cloud = model.upsample(shape.sparse[rate], rate=rate)
        seconds += time.process_time() - start
        found.append(scores(cloud, shape))
    return [name, f"{rate}x", *(f"{value:.3f}" for value in np.mean(found, 0)), f"{seconds:.1f}"]


@click.command()
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--first", type=click.IntRange(1), help="Only so many of the shapes.")
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/ablation.json.")
def main(file: Path, first: int | None, saving: bool) -> None:
    """Print a row for each step and rate, of the shapes in FILE."""
    shapes, rows = read(file)[:first], []
    try:
        default = pcsr.load()
        for rate in INPUTS:
            rows.append(row(f"`{DEFAULT}`", default, shapes, rate))
            for step in STEPS:
                with mock.patch.object(*STEPS[step]):
                    rows.append(row(f"without {step}", pcsr.load(), shapes, rate))
            rows += [row(f"`{name}`", pcsr.load(name), shapes, rate) for name in ("frames", "midpoint")]
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    show(COLUMNS, rows, f"{len(shapes)} shapes, distances ×10³")
    if saving:
        save("ablation", f"python benchmarks/ablation.py {file.name} --save", COLUMNS, rows)


if __name__ == "__main__":
    main()
