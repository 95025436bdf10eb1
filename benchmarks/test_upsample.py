"""`pcsr upsample` at four times the points, from 10,000 to 2 million of them: new points a second, memory, growth.

make bench ARGS=benchmarks/test_upsample.py
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from processes import run
from scipy.spatial import cKDTree

from pcsr.geometry.neighbours import knn

RATE = 4
SIZES = (10_000, 100_000, 500_000, 2_000_000)
CORES = os.cpu_count() or 1
SMALL = 256
"""Points of the cloud that start-up is measured with: one patch."""
LARGE = 100_000
"""From so many points on growth is looked at: below, start-up is too much of it."""
NEAREST = "16 nearest of 65,536 points"


def wavy(count):
    """Points on a wavy closed surface: whatever their number, it is the same shape, only sampled more finely."""
    way = np.random.default_rng(0).normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    x, y, z = way.T
    return way * (1 + 0.1 * np.sin(5 * x + 1) * np.sin(4 * y) * np.cos(6 * z))[:, None]


def command(folder, count):
    """What a person would type, for a cloud of so many points."""
    given = folder / f"{count}.npy"
    np.save(given, wavy(count))
    out = str(folder / "dense.ply")
    return [
        sys.executable, "-m", "pcsr.cli", "upsample", str(given), "-o", out,
        "--rate", str(RATE), "--jobs", str(CORES), "--quiet",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """Seconds that starting all processes takes."""
    return run(command(tmp_path_factory.mktemp("start"), SMALL))[0]


@pytest.fixture(scope="module")
def found():
    """Points to seconds without start-up and to peak bytes, of the sizes so far."""
    return {}


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("count", SIZES)
def test_upsample(benchmark, line, tmp_path, start, found, count):
    line(f"upsample {count:,} points by {RATE}, {CORES} cores", "ours", "seconds ~ points^≤1.05")
    seconds, peak = benchmark.pedantic(run, (command(tmp_path, count),), rounds=1)
    made = (RATE - 1) * count
    says = f"{made / seconds / CORES:,.0f} new points a second and core, {peak / 1e6:,.0f} MB"
    if count >= LARGE:
        found[count] = seconds - start, peak
    if len(found) > 1 and count == SIZES[-1]:
        points, (taken, held) = np.array([*found]), np.array([*found.values()]).T
        exponent = np.polyfit(np.log(points), np.log(taken), 1)[0]
        says += (
            f"; from {points[0]:,} on seconds, without {start:.1f} of start-up, ~ points^{exponent:.2f} "
            f"and memory {np.polyfit(points, held, 1)[0]:,.0f} bytes a point"
        )
    benchmark.extra_info["says"] = says


@pytest.fixture
def cloud():
    return torch.from_numpy(wavy(65_536)).float()


def test_knn(benchmark, line, cloud):
    line(NEAREST, "ours", "memory not ~ n²", f"all distances at once: {4e-9 * len(cloud) ** 2:.0f} GB")
    benchmark(knn, cloud[None], cloud[None], 16)


def test_knn_in_chunks(benchmark, line, cloud):
    line(NEAREST, "usual")

    def usual():
        return torch.cat([torch.cdist(part, cloud).topk(16, largest=False).indices for part in cloud.split(1024)])

    benchmark.pedantic(usual, rounds=1)


def test_knn_by_a_tree(benchmark, line, cloud):
    """The tree's own time, its making included."""
    line(NEAREST, "limit")
    points = cloud.double().numpy()
    benchmark(lambda: cKDTree(points).query(points, 16))
