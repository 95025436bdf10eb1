"""`Model.upsample` with expected errors beside the same without, in one run.

make bench ARGS=benchmarks/test_errors.py

Seconds are those of the processor, which other work on the machine lengthens less; the least of the rounds counts.
"""

import time

import pytest
import torch
from test_upsample import RATE, wavy

import pcsr
from pcsr.clouds.cloud import Cloud

POINTS, ROUNDS = 10_000, 3


@pytest.mark.parametrize("name", ["field", "midpoint", "tapsr"])
@pytest.mark.parametrize(("role", "fields"), [("limit", ()), ("ours", ("error",))])
def test_upsampling_with_expected_errors(benchmark, line, name, role, fields):
    line(f"upsample {POINTS:,} points by {RATE} with `{name}` and expected errors; limit: without", role)
    torch.set_num_threads(1)
    model, cloud, seconds = pcsr.load(name), Cloud(wavy(POINTS)), []

    def upsample(points):
        start = time.process_time()
        model.upsample(points, rate=RATE, fields=fields)
        seconds.append(time.process_time() - start)

    upsample(Cloud(cloud.points[:1000]))
    seconds.clear()
    benchmark.pedantic(upsample, (cloud,), rounds=ROUNDS)
    benchmark.extra_info |= {"seconds": min(seconds)}
