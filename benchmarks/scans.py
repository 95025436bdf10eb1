"""Scans of one's own at four times their points: seconds, memory, and whether the borders of patches show.

python benchmarks/scans.py scan.ply another.ply [--save]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from processes import run
from rich.console import Console
from rich.table import Table
from saved import save
from scipy.spatial import cKDTree

from pcsr.clouds.formats import read_points
from pcsr.geometry.patches import cells
from pcsr.upsample.candidates import Midpoints

LOOKED_AT = 20_000
"""Points at which the density is measured."""
OTHERS = (0.78, 0.9, 1.13, 1.29)
"""Sizes of cells, relative to those of the patches, that no patch has anything to do with."""


def seams(points: np.ndarray, dense: np.ndarray) -> float:
    """How many more new points the borders of patches have than the middles; 1 where no border shows.

    Points whose neighbours are in another cell lie in sparser regions than others, whatever the cells are. So the
    borders of the patches' own cells are compared with those of cells of other sizes.
    """
    rows = np.random.default_rng(0).choice(len(points), min(LOOKED_AT, len(points)), replace=False)
    given, made = cKDTree(points), cKDTree(dense)
    distance, near = given.query(points[rows], k=7)
    radius = 2 * distance[:, 1:].mean(1)
    count = made.query_ball_point(points[rows], radius, return_length=True)
    rate = count / given.query_ball_point(points[rows], radius, return_length=True)

    def at_borders(size: int) -> float:
        owner = np.zeros(len(points), np.int64)
        for number, cell in enumerate(cells(points, size)):
            owner[cell] = number
        border = (owner[near] != owner[near[:, :1]]).any(1)
        return float(rate[border].mean() / rate[~border].mean())

    size = Midpoints().size // 2
    return at_borders(size) / float(np.mean([at_borders(round(other * size)) for other in OTHERS]))


if __name__ == "__main__":
    columns, rows = ("scan", "points", "model", "seconds", "new points a second", "peak MB", "density at seams"), []
    for path in (Path(word) for word in sys.argv[1:] if word != "--save"):
        points = read_points(path)
        for model in ("tapsr", "midpoint"):
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / "dense.npy"
                command = ["pcsr.cli", "upsample", str(path), "-o", str(out), "--model", model, "--bad", "drop"]
                seconds, peak = run([sys.executable, "-m", *command])
                dense = read_points(out)
            made = len(dense) - len(points)
            speed = (f"{seconds:.1f}", f"{made / seconds:,.0f}", f"{peak / 1e6:.0f}")
            rows.append([path.stem, f"{len(points):,}", f"`{model}`", *speed, f"{seams(points, dense):.2f}"])
            Console().print(f"{path.stem} {model}: {seconds:.1f} s, {peak / 1e6:.0f} MB")
    table = Table(*columns)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    if "--save" in sys.argv:
        save("scans", "python benchmarks/scans.py FILE… --save", columns, rows)
