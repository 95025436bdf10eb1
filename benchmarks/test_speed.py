"""New points a second on one core: `Model.upsample` as it is, beside the same without what made it fast, in one run.

make bench ARGS=benchmarks/test_speed.py

The slow way is how it was before:

- encoder, backbone and upsampler each fit the local frames of the cloud,
- convolutions make a new tensor for each sum,
- each step in a patch searches the neighbours again,
- quadrics are fitted to all neighbourhoods, though they are flat,
- the isolation of all candidates is computed, not of those at stray points alone,
- patches have 512 points, cores are half of a patch, and candidates of the whole margin compete,
- freed memory goes back to the system. This cannot be undone within a process, so the slow rounds come first.

Seconds are those of the processor, which other work on the machine lengthens less; the least of the rounds counts.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np
import torch
from test_upsample import RATE, wavy
from torch.nn.functional import relu

import pcsr
from pcsr.geometry.neighbours import gather
from pcsr.upsample import candidates, dense, patch
from pcsr.upsample.neighbours import Neighbours
from pcsr.upsample.noise import Quadrics
from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LocalFrames

POINTS, ROUNDS = 20_000, 3
WHAT = f"upsample {POINTS:,} points by {RATE} on one core, the default model"
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

    def convolved(layer, features, frames, edges):
        there = gather(layer.there(features), frames.index)
        messages = relu(layer.here(features).unsqueeze(2) + there + layer.edge(edges))
        return layer.out(torch.cat([messages.amax(2), messages.mean(2)], dim=-1))

    def noisy(quadrics):
        return 0.0 if quadrics.residual.min() < 0 else quick_noisy(quadrics)

    patch_isolation, quick_noisy = patch.isolation, Quadrics.noisy
    with (
        mock.patch.multiple(patch, BORDER=np.inf, isolation=of_all),
        mock.patch.multiple(patch, **{name: searching(getattr(patch, name)) for name in SEARCHING}),
        mock.patch.object(dense, "core_size", lambda size: size // 2),
        mock.patch.object(candidates, "LOCAL_SIZE", 512),
        mock.patch.object(LocalFrames, "of", LocalFrames._fit),
        mock.patch.object(LocalFrameConv, "forward", convolved),
        mock.patch.object(Quadrics, "noisy", noisy),
        mock.patch.object(candidates, "_keep_freed_memory"),
    ):
        yield


def measured(benchmark, line, role):
    """Measure upsampling by `RATE` in processor seconds, after a warm-up."""
    line(WHAT, role, "usual ÷ ours ≥ 2.5")
    torch.set_num_threads(1)
    model, cloud, made, seconds = pcsr.load(), wavy(POINTS), (RATE - 1) * POINTS, []

    def upsample(points):
        start = time.process_time()
        model.upsample(points, rate=RATE)
        seconds.append(time.process_time() - start)

    upsample(cloud[:1000])
    seconds.clear()
    benchmark.pedantic(upsample, (cloud,), rounds=ROUNDS)
    speed = f"{made / min(seconds):,.0f} new points a second and core"
    benchmark.extra_info |= {"seconds": min(seconds), "says": f"{role}: {speed} (least of {ROUNDS} rounds)"}


def test_the_slow_way(benchmark, line):
    with slow_way():
        measured(benchmark, line, "usual")


def test_as_it_is(benchmark, line):
    measured(benchmark, line, "ours")
