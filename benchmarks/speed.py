"""New points a second on one core: `Model.upsample` as it is, beside the same without what made it fast, in one run.

python benchmarks/speed.py [MODEL] [--points 20000] [--rounds 3]

The slow way differs as follows. Convolutions in place and quadrics that are not fitted stay, so the ratio is a lower
bound of what was gained:

- encoder, backbone and upsampler each fit the local frames of the cloud,
- each step in a patch searches the neighbours again,
- the isolation of all candidates is computed, not of those at stray points alone,
- candidates of the whole margin compete, and cores are half of a patch,
- freed memory goes back to the system. This cannot be undone within a process, so the slow rounds come first.

Seconds are those of the processor, which other work on the machine lengthens less; the least of the rounds counts.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import click
import numpy as np
import torch
from test_upsample import RATE, wavy

import pcsr
from pcsr.upsample import candidates, dense, patch
from pcsr.upsample.neighbours import Neighbours
from pcsr_plugins.layers.local_frames import LocalFrames

SEARCHING = ("spacing", "strays", "on_wires", "pattern", "between")
"""Functions of a patch that search neighbours, if they get points alone."""


@contextmanager
def slow_way() -> Iterator[None]:
    """Take away what made upsampling fast, for the length of a block."""

    def searching(function):
        return lambda cloud, *rest: function(cloud.points if isinstance(cloud, Neighbours) else cloud, *rest)

    def of_all(points, some, unit):
        everyone = patch_isolation(points, np.arange(len(points)), np.ones(len(points)))
        return everyone[some] / unit

    patch_isolation = patch.isolation
    with (
        mock.patch.multiple(patch, BORDER=np.inf, isolation=of_all),
        mock.patch.multiple(patch, **{name: searching(getattr(patch, name)) for name in SEARCHING}),
        mock.patch.object(dense, "CORE", 0.5),
        mock.patch.object(LocalFrames, "of", LocalFrames._fit),
        mock.patch.object(candidates, "_keep_freed_memory"),
    ):
        yield


def seconds(model: pcsr.Model, cloud: np.ndarray) -> float:
    """Processor seconds of one upsampling."""
    start = time.process_time()
    model.upsample(cloud, rate=RATE)
    return time.process_time() - start


@click.command()
@click.argument("model", default="frames")
@click.option("--points", type=click.IntRange(16), default=20_000, show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=3, show_default=True)
def main(model: str, points: int, rounds: int) -> None:
    """Print new points a second and core of MODEL at 4x, the slow way and as it is, and their ratio."""
    torch.set_num_threads(1)
    loaded, cloud, made = pcsr.load(model), wavy(points), (RATE - 1) * points
    with slow_way():
        loaded.upsample(cloud[:1000], rate=RATE)
        before = min(seconds(loaded, cloud) for _ in range(rounds))
    loaded.upsample(cloud[:1000], rate=RATE)
    after = min(seconds(loaded, cloud) for _ in range(rounds))
    for name, taken in {"slow way": before, "as it is": after}.items():
        click.echo(f"{name}: {taken:.2f} s, {made / taken:,.0f} new points a second and core")
    click.echo(f"ratio: {before / after:.2f}")


if __name__ == "__main__":
    main()
