"""Scans of one's own at four times their points: seconds, memory, and whether the borders of patches show.

python benchmarks/scans.py scan.ply another.ply
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from processes import run
from rich.console import Console
from rich.table import Table
from scipy.spatial import cKDTree

from pcsr.clouds.formats import read_points
from pcsr.geometry.patches import cells
from pcsr.upsample.candidates import Midpoints

LOOKED_AT = 20_000
"""Points at which the density is measured."""


def seams(points: np.ndarray, dense: np.ndarray) -> float:
    """Spacing of the dense cloud at the borders of cells over that in their middles; 1 where no border shows.

    Both relative to the spacing of the given points there, as that may differ from place to place.
    """
    owner = np.zeros(len(points), np.int64)
    for number, rows in enumerate(cells(points, Midpoints().size // 2)):
        owner[rows] = number
    places = dense[np.random.default_rng(0).choice(len(dense), min(LOOKED_AT, len(dense)), replace=False)]
    distance, near = cKDTree(points).query(places, k=6)
    at_border = (owner[near] != owner[near[:, :1]]).any(1)
    ratio = cKDTree(dense).query(places, k=7)[0][:, 1:].mean(1) / np.maximum(distance.mean(1), 1e-12)
    return float(np.median(ratio[at_border]) / np.median(ratio[~at_border]))


if __name__ == "__main__":
    table = Table("scan", "points", "model", "seconds", "new points a second", "peak MB", "spacing at seams")
    for path in map(Path, sys.argv[1:]):
        points = read_points(path)
        for model in ("tapsr", "midpoint"):
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / "dense.npy"
                command = ["pcsr.cli", "upsample", str(path), "-o", str(out), "--model", model, "--bad", "drop"]
                seconds, peak = run([sys.executable, "-m", *command])
                dense = read_points(out)
            made = len(dense) - len(points)
            table.add_row(
                *(path.stem, str(len(points)), model, f"{seconds:.1f}", f"{made / seconds:.0f}"),
                *(f"{peak / 1e6:.0f}", f"{seams(points, dense):.3f}"),
            )
            Console().print(f"{path.stem} {model}: {seconds:.1f} s, {peak / 1e6:.0f} MB")
    Console().print(table)
