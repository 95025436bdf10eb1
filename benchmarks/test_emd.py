"""Earth mover's distance of 8192 points: an interpolated part and its truth.

make bench ARGS=benchmarks/test_emd.py
"""

import multiprocessing
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pcsr.geometry.interpolation import midpoint
from pcsr.geometry.sampling import poisson_points
from pcsr.metrics.emd import TOLERANCE
from pcsr.metrics.transport import mean_distance
from pcsr_plugins.shapes.cad_parts import CadParts

WHAT = "emd 8192 × 8192"
ASKED = "≥ 12 × scipy's dense solver; < 300 MB"


@pytest.fixture(scope="module")
def clouds():
    shapes, rng = CadParts(count=1, held_out=1), np.random.default_rng(0)
    truth = poisson_points(shapes.item(shapes.names("test")[0]).mesh, 8192, rng)
    return midpoint(truth[rng.choice(8192, 512, replace=False)], 16, 2), truth


def most_held():
    """The most bytes that this process ever held (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def memory(clouds):
    """Bytes that a fresh process needs for it, its imports left out."""
    mean_distance(*(cloud[:2] for cloud in clouds), TOLERANCE)
    before = most_held()
    mean_distance(*clouds, TOLERANCE)
    return most_held() - before


def test_ours(benchmark, line, clouds):
    line(WHAT, "ours", ASKED)
    mean, bound = benchmark(mean_distance, *clouds, TOLERANCE)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        peak = pool.apply(memory, (clouds,))
    benchmark.extra_info["says"] = f"at most {(mean - bound) / bound:.1e} above the least; {peak / 1e6:.0f} MB"


def test_all_points_on_one_spot(benchmark, line, clouds):
    line("emd 8192 × 8192, all predicted points on one spot", "ours")
    prediction = np.full((8192, 3), 1.0)
    mean, _ = benchmark(mean_distance, prediction, clouds[1], TOLERANCE)
    assert mean == pytest.approx(np.linalg.norm(prediction - clouds[1], axis=1).mean())


def test_scipy(benchmark, line, clouds):
    line(WHAT, "usual")

    def usual():
        cost = cdist(*clouds)
        return cost[linear_sum_assignment(cost)].mean()

    least = benchmark.pedantic(usual, rounds=1)
    assert mean_distance(*clouds, TOLERANCE)[0] == pytest.approx(least, rel=TOLERANCE)
