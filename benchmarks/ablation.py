"""What each step of upsampling brings, on PU-GAN's test shapes: the default model, with one step taken away at a time.

python benchmarks/ablation.py pugan21.npz [--first 5] [--save]

Each row is `Model.upsample` without touches, as in benchmarks/pugan.py, with its metrics. The last two rows of a rate
are of other candidates: the weights that the default's training started from, and interpolation. Seconds are of the
processor, for all shapes of a rate.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import click
import numpy as np
from pugan import INPUTS, METRICS, SHIFTED, SPACING, Shape, read, scores
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from saved import save

import pcsr
from pcsr.errors import PcsrError
from pcsr.upsample import candidates, dense, patch, selection
from pcsr.weights import DEFAULT
from pcsr_plugins.upsamplers.rated_edges import RatedEdges

COLUMNS = ("method", "rate", *METRICS, SHIFTED, SPACING, "seconds")


@contextmanager
def without(step: str) -> Iterator[None]:
    """Take a step away for the length of a block."""
    same = {
        "predicted errors in the choice": mock.patch.object(selection, "CAUTION", 0.0),
        "corrected copies of generated points": mock.patch.object(RatedEdges, "corrects_points", False),
        "shares by cells of a core": mock.patch.object(patch, "CELL", 1 << 30),
        "shares by area": mock.patch.object(dense, "weights", lambda cloud, plan: np.ones(len(cloud))),
        "patches of 1,024 points, but of 512": mock.patch.object(candidates, "LOCAL_SIZE", 512),
    }
    with same[step]:
        yield


STEPS = (
    "predicted errors in the choice",
    "corrected copies of generated points",
    "shares by cells of a core",
    "shares by area",
    "patches of 1,024 points, but of 512",
)
"""Steps that are taken away, one at a time."""


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
                with without(step):
                    rows.append(row(f"without {step}", pcsr.load(), shapes, rate))
            rows += [row(f"`{name}`", pcsr.load(name), shapes, rate) for name in ("frames", "midpoint")]
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    table = Table(*COLUMNS, title=f"{len(shapes)} shapes, distances ×10³", box=box.MARKDOWN)
    for cells in rows:
        table.add_row(*cells)
    Console(width=1000).print(table)
    if saving:
        save("ablation", f"python benchmarks/ablation.py {file.name} --save", COLUMNS, rows)


if __name__ == "__main__":
    main()
