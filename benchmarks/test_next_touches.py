"""Time of `pcsr.next_touches`: five poses for one camera's view of 2,000, 10,000 and 50,000 points.

make bench ARGS=benchmarks/test_next_touches.py

Seconds are those of the processor, which other work on the machine lengthens less.
"""

import time

import numpy as np
import pytest

import pcsr


def view(count):
    """The upper side of an ellipsoid 80 mm long."""
    points = np.random.default_rng(0).normal(size=(3 * count, 3))
    points *= np.array([40.0, 30.0, 25.0]) / np.linalg.norm(points, axis=1, keepdims=True)
    return points[points[:, 2] > 2][:count]


@pytest.mark.benchmark(group="five poses", timer=time.process_time)
@pytest.mark.parametrize("count", [2_000, 10_000, 50_000])
def test_five_poses(benchmark, count):
    cloud = view(count)
    found = benchmark.pedantic(pcsr.next_touches, [cloud], {"count": 5}, rounds=3, warmup_rounds=1)
    assert len(found) == 5
    assert found[0].guessed
