"""`pcsr upsample` of a large cloud from disk to disk: seconds, memory, and the same bytes after SIGKILL (Linux).

python benchmarks/large.py 20000000 --jobs 2 --kill

The cloud is a made landscape with houses and trees, in colours, with a class for each point. It is written in chunks,
so that this script needs no more memory for a larger one. The command runs with `--stream`, whatever the size.
"""

import datetime
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from processes import run
from rich.console import Console
from rich.table import Table
from saved import save

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats.row_writing import row_writer
from pcsr.files import sha256
from pcsr.streaming.examples import deciding, joined
from pcsr.streaming.tiles import depth_for
from pcsr.streaming.upsampling import TILE
from pcsr.streaming.work_folder import SUFFIX
from pcsr.weights import DEFAULT

COLUMNS = ("points", "processes", "seconds", "new points a second", "peak memory of all processes", "bytes")
CHUNK = 1 << 18
"""Points that are made at once: a strip of the landscape."""
DENSITY = 16.0
"""Points per square metre."""
LOT = 40.0
"""Metres between houses."""
GROUND, TREE, HOUSE = 2, 5, 6
"""Classes of LAS."""


def strip(number: int, low: float, high: float, width: float, count: int) -> Cloud:
    """One strip of the landscape, across the direction of flight."""
    rng = np.random.default_rng(number)
    x, y = rng.uniform(low, high, count), rng.uniform(0, width, count)
    ground = 20 * np.sin(x / 150) * np.cos(y / 200) + 2 * np.sin(x / 23 + y / 31)
    label = np.full(count, GROUND, np.uint8)
    z = ground + 0.01 * rng.normal(size=count)
    in_lot = np.stack([x, y], 1) % LOT - LOT / 2
    house = (np.abs(in_lot) < [6, 4]).all(1)
    z[house] += 6 - 0.5 * np.abs(in_lot[house, 1])
    label[house] = HOUSE
    crown = np.linalg.norm(in_lot - [12, 12], axis=1) / 4
    tree = crown < 1
    z[tree] += 6 + 4 * np.sqrt(1 - crown[tree] ** 2) * rng.choice([-1, 1], int(tree.sum()))
    label[tree] = TREE
    colours = np.array([[120, 100, 60], [40, 130, 50], [180, 70, 60]], np.uint8)[np.searchsorted([2, 5, 6], label)]
    colours = colours + rng.integers(0, 16, (count, 3), dtype=np.uint8)
    points = np.round(np.stack([x + 500_000, y + 5_400_000, z], 1), 3)
    columns = dict(zip(("red", "green", "blue"), colours.T, strict=True))
    return Cloud(points, {**columns, "intensity": rng.integers(0, 4096, count).astype(np.uint16), "class": label})


def strips(count: int) -> Iterator[Cloud]:
    """All strips of a square landscape of so many points."""
    side, at = (count / DENSITY) ** 0.5, 0
    while at < count:
        more = min(CHUNK, count - at)
        yield strip(at, side * at / count, side * (at + more) / count, side, more)
        at += more


def make(path: Path, count: int) -> None:
    """Write the landscape to a file."""
    examples: list[Cloud] = []
    for one in strips(count):
        few = joined([*examples, one.chosen(deciding(one))])
        examples = [few.chosen(deciding(few))]
    writer = row_writer(path.suffix, examples[0], datetime.date(2000, 1, 1))
    writer.write(path, count, (writer.rows(one) for one in strips(count)))


def killed(command: list[str], out: Path, share: float, tiles: int) -> None:
    """Run a command, and kill it with all its processes when the given share of the tiles is done."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    parts = out.with_name(out.name + SUFFIX)
    while process.poll() is None and len(list(parts.glob("new-*.npy"))) < max(1, share * tiles):
        time.sleep(0.05)
    if process.poll() is not None:
        raise SystemExit("the command ended before it could be killed")
    time.sleep(0.5)  # into the middle of a tile
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@click.command()
@click.argument("counts", type=int, nargs=-1, required=True)
@click.option("--jobs", default=1, show_default=True)
@click.option("--model", default=DEFAULT, show_default=True)
@click.option("--rate", default=4.0, show_default=True)
@click.option("--format", "kind", default="las", show_default=True, help="las, laz, ply or npy, of IN and OUT.")
@click.option("--folder", type=click.Path(path_type=Path), default=None, help="Where the files lie.")
@click.option("--kill", is_flag=True, help="Kill the command in the middle, run it again and compare.")
@click.option("--save", "saved", is_flag=True, help="Write the table for the pages.")
def main(
    counts: tuple[int, ...],
    jobs: int,
    model: str,
    rate: float,
    kind: str,
    folder: Path | None,
    kill: bool,
    saved: bool,
) -> None:
    """Measure `pcsr upsample --stream` on made landscapes of COUNTS points."""
    rows: list[tuple[str, ...]] = []
    options = ["--model", model, "--rate", str(rate), "--jobs", str(jobs), "--stream"]
    for count in counts:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            given, whole, again = (Path(scratch) / f"{name}.{kind}" for name in ("given", "whole", "again"))
            make(given, count)
            command = [sys.executable, "-m", "pcsr.cli", "upsample", str(given), *options, "-o"]
            seconds, peak = run([*command, str(whole)])
            speed = f"{(rate - 1) * count / seconds:,.0f}"
            rows.append((f"{count:,}", str(jobs), f"{seconds:.0f}", speed, f"{peak / 1e6:,.0f} MB", "–"))
            if kill:
                killed([*command, str(again)], again, 0.5, 2 ** depth_for(count, TILE))
                seconds, peak = run([*command, str(again)])
                same = "equal" if sha256(again) == sha256(whole) else "DIFFERENT"
                rows.append(
                    (f"{count:,}", str(jobs), f"{seconds:.0f} after SIGKILL", "", f"{peak / 1e6:,.0f} MB", same)
                )
    table = Table(*COLUMNS)
    for row in rows:
        table.add_row(*row)
    Console(width=120).print(table)
    if saved:
        save("large", f"python benchmarks/{' '.join([Path(sys.argv[0]).name, *sys.argv[1:]])}", COLUMNS, rows)
    if any(row[-1] == "DIFFERENT" for row in rows):
        raise SystemExit("the bytes differ")


if __name__ == "__main__":
    main()
