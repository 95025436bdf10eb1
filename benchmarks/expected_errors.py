"""Are expected errors calibrated? The share of new points that lie within their expected error, in ten bins of it.

python benchmarks/expected_errors.py [pugan21.npz] [--parts 24] [--models field,midpoint,tapsr] [--save]

The parts are those of pcsr/recipes/touch/parts.yaml, the test split, scaled to 30 mm: 512 points, at random or as depth
cameras see them, 4x. Noise is Gaussian, in percent of the radius of the cloud: on each axis, or along the rays of
cameras. With FILE, PU-GAN's shapes too: 2048 points, 4x, scaled to a radius of 1. Bins have equal numbers of points.
The standard error of a share is that over the shapes, by 200 resamplings. The networks that predict the errors were
fitted to other shapes (benchmarks/fit_errors.py).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import pugan
import trimesh
from error_clouds import distances, noisy, radius
from reliability_chart import BINS, COLUMNS, draw
from rich.console import Console
from rich.progress import track
from saved import NUMBERS, save, show

import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.data.sample import make_sample
from pcsr.errors import PcsrError
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load

RECIPE = Path(__file__).parents[1] / "pcsr/recipes" / "touch" / "parts.yaml"
RATE = 4
NOISE = 0.01
LONGEST = 30.0
"""Longest side of a part, in mm."""
RESAMPLINGS = 200
PARTS = {
    "parts, random": (),
    "parts, random, 1 % noise": (),
    "parts, one camera": ("data.sampling=view",),
    "parts, four cameras, 1 % noise": ("data.sampling=view", "data.view.cameras=4", f"data.view.noise={NOISE}"),
    "parts, 2048 random, 1 % noise, --denoise": ("data.points=2048", "data.rate=4"),
}
"""Kinds of clouds of parts, with the settings of the recipe."""
SHAPES = ("PU-GAN's shapes", "PU-GAN's shapes, 1 % noise")


@dataclass(frozen=True)
class Scan:
    """A cloud of a known surface."""

    mesh: trimesh.Trimesh
    points: np.ndarray
    denoise: bool = False


@dataclass(frozen=True)
class Told:
    """Expected and true errors of the new points of one shape."""

    expected: np.ndarray
    true: np.ndarray


def scans_of_parts(kind: str, count: int) -> Iterator[Scan]:
    """Clouds of the first test parts."""
    registry = load_plugins()
    (recipe,) = load(RECIPE, registry, PARTS[kind])
    shapes = recipe.data.shapes.build(registry, "shapes")
    touch = recipe.data.touch.build(registry, "touch")
    for name in shapes.names("test")[:count]:
        item = shapes.item(name)
        sample = make_sample(item, touch, recipe.data, 0, recipe.data_seed)
        vertices = np.asarray(item.mesh.vertices)
        scale = LONGEST / float(np.ptp(vertices, axis=0).max())
        points = scale * sample.sphere.denormalize(sample.points)
        rng = np.random.default_rng([0, *name.encode()])
        if "random" in kind and "noise" in kind:
            points = noisy(points, NOISE, rng)
        yield Scan(trimesh.Trimesh(scale * vertices, item.mesh.faces, process=False), points, "denoise" in kind)


def scans_of_shapes(file: Path, kind: str) -> Iterator[Scan]:
    """Clouds of PU-GAN's shapes."""
    for number, shape in enumerate(pugan.read(file)):
        points = shape.sparse[RATE]
        scale = 1 / radius(points)
        mesh = trimesh.Trimesh(scale * shape.mesh.vertices, shape.mesh.faces, process=False)
        points = scale * points
        rng = np.random.default_rng([0, number])
        yield Scan(mesh, noisy(points, NOISE, rng) if "noise" in kind else points)


def told(model: pcsr.Model, scan: Scan) -> Told:
    """Upsample a cloud with errors, and measure the true ones."""
    dense = model.upsample(Cloud(scan.points), rate=RATE, fields=["error"], denoise=scan.denoise)
    new = len(scan.points)
    return Told(dense.columns["error"][new:], distances(dense.points[new:], scan.mesh))


def bins(shapes: Sequence[Told]) -> list[list[str]]:
    """Cells of each bin: points, expected error, the true one at the same quantile, share within, standard error."""
    expected, true = (np.concatenate([getattr(one, name) for one in shapes]) for name in ("expected", "true"))
    of_shape = np.repeat(np.arange(len(shapes)), [len(one.true) for one in shapes])
    rng, rows = np.random.default_rng(0), []
    for members in np.array_split(np.argsort(expected, kind="stable"), BINS):
        within = true[members] <= expected[members]
        hits = np.bincount(of_shape[members], within, len(shapes))
        counts = np.bincount(of_shape[members], minlength=len(shapes))
        drawn = rng.integers(len(shapes), size=(RESAMPLINGS, len(shapes)))
        spread = (hits[drawn].sum(1) / np.maximum(counts[drawn].sum(1), 1)).std()
        actual = np.quantile(true[members], 0.68)
        values = (np.median(expected[members]), actual, 100 * within.mean(), 100 * spread)
        rows.append([str(len(members)), f"{values[0]:.3g}", f"{values[1]:.3g}", f"{values[2]:.0f}", f"{values[3]:.1f}"])
    return rows


@click.command()
@click.argument("file", required=False, type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--parts", "count", type=click.IntRange(1, 24), default=24, show_default=True)
@click.option("--models", default="field,midpoint,tapsr", show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/expected-errors.json and the picture.")
def main(file: Path | None, count: int, models: str, saving: bool) -> None:
    """Print the bins of each kind of cloud and model, and the picture of them."""
    rows = []
    try:
        loaded = [pcsr.load(name) for name in models.split(",")]
        kinds = [*PARTS, *(SHAPES if file else ())]
        for kind in track(kinds, "kinds of clouds", console=Console(stderr=True), transient=True):
            scans = list(scans_of_parts(kind, count) if kind in PARTS or file is None else scans_of_shapes(file, kind))
            for model in loaded:
                found = bins([told(model, scan) for scan in scans])
                rows += [[kind, model.name, str(number), *cells] for number, cells in enumerate(found, 1)]
                shares = [int(cells[3]) for cells in found]
                click.echo(
                    f"{kind}, {model.name}: {' '.join(map(str, shares))}, mean {np.mean(shares):.0f} %", err=True
                )
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    show(COLUMNS, rows)
    if saving:
        command = " ".join(["python benchmarks/expected_errors.py", *([file.name] if file else []), "--save"])
        save("expected-errors", command, COLUMNS, rows)
        draw(rows, NUMBERS.parent / "pictures" / "reliability.png")


if __name__ == "__main__":
    main()
