"""Plates, wires, strays, noise and density patterns through `Model.upsample` at 4x, as `pcsr upsample` uses it.

python benchmarks/thin.py [MODEL…] [--seed 0] [--only plate] [--save]
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import click
import numpy as np
from jaxtyping import Bool, Float
from rich.console import Console
from rich.progress import track
from saved import save, show
from scipy.spatial import cKDTree
from thin_scenes import Scene, camera_step, floor, helix, in_dense, plate, sphere, strays, stripes, wire_by_step

import pcsr
from pcsr.errors import PcsrError
from pcsr.model import INTERPOLATION
from pcsr.weights import DEFAULT

RATE = 4
MARGIN = 0.2
"""A point hangs between two sheets if it is farther from both than this share of their distance."""
OFF = 0.25
"""A point is off the surface if it is farther away than this, in spacings."""
Points = Float[np.ndarray, "_ 3"]


def between(thickness: float, scene: Scene, new: Points) -> float:
    """The share of new points that hang between the sheets z = 0 and z = `thickness`."""
    inside = (new[:, 2] > 0) & (new[:, 2] < thickness)
    return float((inside & (scene.distance(new) > MARGIN * thickness)).mean())


def off_wire(scene: Scene, new: Points) -> float:
    """The share of the wire's new points that are off every surface; a new point belongs to its nearest old point."""
    own = owned(scene, new)
    return float((scene.distance(new[own]) > OFF * scene.spacing).mean())


def each(scene: Scene, new: Points) -> float:
    """The number of new points for each of the marked points; a new point belongs to its nearest old point."""
    return float(owned(scene, new).sum() / scene.marked.sum())


def owned(scene: Scene, new: Points) -> Bool[np.ndarray, " new"]:
    """Which new points belong to the marked points of a scene."""
    nearest: Bool[np.ndarray, " new"] = scene.marked[cKDTree(scene.cloud.points).query(new)[1]]
    return nearest


def error(scene: Scene, new: Points) -> float:
    """The mean distance of the new points to the true surface."""
    return float(scene.distance(new).mean())


def worst(scene: Scene, new: Points) -> float:
    """The largest distance of a new point to the true surface."""
    return float(scene.distance(new).max())


def contrast(number: int, scene: Scene, new: Points) -> float:
    """The rate of the dense stripes as a multiple of that of the others: 1 keeps the pattern, 1/4 levels it."""
    made, given = in_dense(new, number), in_dense(scene.cloud.points, number)
    return float((made.sum() / given.sum()) / ((~made).sum() / (~given).sum()))


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    measure: str
    scene: Scene
    value: Callable[[Scene, Points], float]
    form: str
    """How the number is written."""


def rows(seed: int) -> Iterator[Row]:
    """All lines of the table."""
    rng = np.random.default_rng(seed)
    for thickness, even in product((1.0, 1.4, 2.0), (False, True)):
        for normals in (False, True):  # the same points
            scene = plate(thickness, np.random.default_rng(seed), even=even, normals=normals)
            yield Row("plate, between the sheets", scene, partial(between, thickness), "{:.1%}")
    for gap, even in product((1.5, 3.0), (False, True)):
        yield Row("wire, off", wire_by_step(0.5, gap, rng, even=even), off_wire, "{:.1%}")
    for radius, even in product((0.5, 0.2), (False, True)):
        yield Row("wire, off", helix(radius, rng, even=even), off_wire, "{:.1%}")
    noisy = floor(rng), sphere(rng), camera_step(rng)
    for scene in (strays(rng), *noisy[1:]):
        yield Row(f"new points each, {RATE - 1} on average", scene, each, "{:.1f}")
    for scene in noisy:
        yield Row("error, mm", scene, error, "{:.2f}")
    yield Row("largest error, mm", noisy[-1], worst, "{:.1f}")
    for number, even in product((2, 6), (False, True)):
        yield Row(
            "density, rate of dense to plain", stripes(number, rng, even=even), partial(contrast, number), "{:.2f}"
        )


def measured(row: Row, model: pcsr.Model, made: dict[str, Points]) -> str:
    """The number of a line for a model. `made` keeps the new points of each scene, by its name."""
    scene = row.scene
    if scene.name not in made:
        made[scene.name] = model.upsample(scene.cloud, rate=RATE).points[len(scene.cloud) :]
    return row.form.format(row.value(scene, made[scene.name]))


@click.command()
@click.argument("models", nargs=-1, metavar="[MODEL]...")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--only", default="", help="Only lines with this text, such as plate or wire.")
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/thin.json.")
def main(models: Sequence[str], seed: int, only: str, saving: bool) -> None:
    """Print a line for each scene, with a column for each MODEL, or for the default one and interpolation."""
    names = models or (DEFAULT, INTERPOLATION)
    chosen = [row for row in rows(seed) if only in f"{row.measure} {row.scene.name}"]
    if not chosen:
        raise click.ClickException(f"--only {only}: no line has this text; try plate, wire, each, error or density")
    try:
        columns = []
        for name in names:
            model, made = pcsr.load(name), {}
            shown = track(chosen, name, console=Console(stderr=True), transient=True)
            columns.append([measured(row, model, made) for row in shown])
    except PcsrError as problem:
        raise click.ClickException(str(problem)) from problem
    heads = ["measure", "scene", *(f"`{name}`" for name in names)]
    cells = [[row.measure, row.scene.name, *values] for row, *values in zip(chosen, *columns, strict=True)]
    show(heads, cells)
    if saving:
        save("thin", f"python benchmarks/thin.py {' '.join(names)} --seed {seed} --save", heads, cells)


if __name__ == "__main__":
    main()
