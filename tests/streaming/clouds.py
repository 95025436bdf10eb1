"""A cloud of several tiles, and its upsampling with small patches."""

import functools

import numpy as np

from pcsr import load
from pcsr.clouds.cloud import Cloud
from pcsr.streaming import job, upsample_file
from pcsr.upsample.candidates import Midpoints

SMALL = Midpoints(size=48, rate=8)
TILE = 300
"""Points of a tile."""


def sheet(count=1500, seed=0):
    """A wavy sheet at map coordinates, with a column of each kind."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 10, (2, count))
    normals = np.stack([-np.cos(x), 0 * x, 0 * x + 1], 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    columns = {
        "red": (25 * x).astype(np.uint8),
        "green": (25 * y).astype(np.uint8),
        "blue": rng.integers(0, 255, count).astype(np.uint8),
        **dict(zip(("nx", "ny", "nz"), normals.astype(np.float32).T, strict=True)),
        "intensity": x.astype(np.float32),
        "label": np.where(x < 5, 3, 7).astype(np.int32),
    }
    return Cloud(np.round(np.stack([x + 500_000, y + 5_400_000, np.sin(x)], 1), 3), columns)


def use_small_patches(monkeypatch):
    """Let patches of this process and its workers have few points, so that a small cloud has many."""
    monkeypatch.setattr(job, "candidates", lambda model, *, alone: SMALL)


@functools.cache
def midpoint():
    return load("midpoint")


def stream(source, target, rate=3, **options):
    """Upsample a file in several tiles; return the bytes."""
    upsample_file(midpoint(), source, target, rate=None if "count" in options else rate, **{"tile": TILE, **options})
    return target.read_bytes()
