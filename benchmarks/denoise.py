"""Noisy clouds of 2048 points to 8192: `pcsr upsample --denoise` beside a bilateral filter and Open3D.

python benchmarks/denoise.py [pugan21.npz] [--first 8] [--save]

Without FILE the shapes are generated: parts of `cad-parts` and bodies of `blobs`. A shape is scaled so that its cloud
without noise fills the unit sphere around its centroid. Noise is Gaussian with the same standard deviation on each
axis, in percent of the sphere's radius; seed 0. Rows of Open3D need `pip install open3d`.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import denoisers
import numpy as np
import trimesh
from rich.console import Console
from rich.progress import track
from saved import save, show

import pcsr
from pcsr.errors import PcsrError
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.sampling import poisson_points
from pcsr.plugins.loading import load_plugins
from pcsr.upsample.denoise import denoise
from pcsr.weights import DEFAULT

LEVELS = (0.0, 0.005, 0.01, 0.02)
COUNT, RATE = 2048, 4
EACH = 2
"""Number of generated shapes of each of two kinds."""
SEED = 0
Points = denoisers.Points
Method = Callable[[Points, float], Points]
"""Makes a dense cloud of a noisy one and the true level of its noise."""


@dataclass(frozen=True)
class Shape:
    """A shape, scaled so that its cloud fills the unit sphere."""

    mesh: trimesh.Trimesh
    cloud: Points
    truth: Points

    @classmethod
    def of(cls, mesh: trimesh.Trimesh, cloud: Points, truth: Points) -> "Shape":
        """Scale a shape."""
        sphere = UnitSphere.fit(cloud)
        vertices, cloud, truth = ((one - sphere.centre) / sphere.radius for one in (mesh.vertices, cloud, truth))
        return cls(trimesh.Trimesh(vertices, mesh.faces, process=False), cloud, truth)

    def noisy(self, level: float) -> Points:
        """The cloud with noise."""
        return self.cloud + np.random.default_rng(SEED).normal(0, level, self.cloud.shape)


def read(file: Path) -> list[Shape]:
    """The shapes of PU-GAN's file, as benchmarks/pugan.py reads it."""
    data = np.load(file)
    meshes = [trimesh.Trimesh(data[f"vertices_{name}"], data[f"faces_{name}"], process=False) for name in data["names"]]
    clouds, truths = (data[key].astype(np.float64) for key in (f"input_{COUNT}", f"gt_{RATE * COUNT}"))
    return list(map(Shape.of, meshes, clouds, truths))


def generated(count: int = EACH) -> list[Shape]:
    """Parts and bodies of the test split, evenly sampled."""
    shapes = []
    for kind in ("cad-parts", "blobs"):
        source = load_plugins().get("shapes", kind)()
        for name in itertools.islice(source.names("test"), count):
            mesh, rng = source.item(name).mesh, np.random.default_rng(SEED)
            shapes.append(Shape.of(mesh, *(poisson_points(mesh, number, rng) for number in (COUNT, RATE * COUNT))))
    return shapes


def methods() -> dict[str, Method]:
    """What is compared."""
    default, midpoint = pcsr.load(DEFAULT), pcsr.load("midpoint")
    goal = RATE * COUNT

    def filtered(points: Points, level: float) -> Points:
        return midpoint.upsample(denoisers.bilateral(points, level) if level else points, count=goal)

    compared: dict[str, Method] = {
        "midpoint": lambda points, level: midpoint.upsample(points, count=goal),
        "bilateral filter, midpoint": filtered,
    }
    if denoisers.installed():
        compared |= {
            "Open3D: outliers removed; midpoint": lambda points, level: midpoint.upsample(
                denoisers.open3d_outliers(points), count=goal
            ),
            "Open3D: outliers removed, Poisson surface, Taubin": lambda points, level: denoisers.open3d_surface(
                points, goal
            ),
        }
    else:
        click.echo("Open3D cannot be imported, and has no rows: pip install open3d", err=True)
    return compared | {
        f"{DEFAULT}": lambda points, level: default.upsample(points, count=goal),
        f"{DEFAULT} --denoise": lambda points, level: default.upsample(points, count=goal, denoise=True),
        f"{DEFAULT} --denoise SIGMA": lambda points, level: default.upsample(points, count=goal, denoise=level or True),
    }


def errors(shapes: Sequence[Shape], method: Method) -> list[float]:
    """The mean `cd` in the truth's frame at each level, then `p2f`, times 10³."""
    found = np.zeros((2, len(LEVELS), len(shapes)))
    for (row, level), (column, shape) in itertools.product(enumerate(LEVELS), enumerate(shapes)):
        dense = method(shape.noisy(level), level)
        values = pcsr.evaluate(dense, shape.truth, shape.mesh, frame="truth", metrics=("cd", "p2f"))
        found[:, row, column] = values["cd"], values["p2f"]
    return [*(1e3 * found.mean(2)).ravel()]


def estimates(shapes: Sequence[Shape]) -> list[list[str]]:
    """The estimated noise in percent of the radius: a row for each level with the quartiles over the shapes."""
    rows = []
    for level in LEVELS:
        found = [100 * denoise(shape.noisy(level)).level for shape in shapes]
        numbers = np.quantile(found, [0, 0.25, 0.5, 0.75, 1])
        rows.append([f"{100 * level:g}", *(f"{one:.2f}" for one in numbers)])
    return rows


@click.command()
@click.argument("file", required=False, type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--first", type=click.IntRange(1), help="Only so many of the shapes.")
@click.option("--only", default="", help="Only methods with this text, such as frames or Open3D.")
@click.option("--save", "saving", is_flag=True, help="Write the tables to docs/numbers.")
def main(file: Path | None, first: int | None, only: str, saving: bool) -> None:
    """Print the errors of each method on the shapes in FILE, or on generated ones, and the estimated noise."""
    try:
        shapes = (read(file) if file else generated())[:first]
        compared = {name: method for name, method in methods().items() if only in name}
        if not compared:
            raise click.ClickException(f"--only {only}: no method has this text; try {DEFAULT} or midpoint")
        rows = []
        for name, method in track(compared.items(), "methods", console=Console(stderr=True), transient=True):
            rows.append([f"`{name}`" if name.startswith(DEFAULT) else name])
            rows[-1] += [f"{value:.2f}" for value in errors(shapes, method)]
        levels = estimates(shapes)
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    percent = [f"{100 * level:g} %" for level in LEVELS]
    columns = ["method", *(f"{metric}, {one}" for metric in ("cd", "p2f") for one in percent)]
    quartiles = ["noise, %", "smallest", "lower quartile", "median", "upper quartile", "largest"]
    show(columns, rows)
    show(quartiles, levels)
    if saving:
        words = [file.name if file else "", f"--first {first}" if first else "", "--save"]
        command = " ".join(["python benchmarks/denoise.py", *filter(None, words)])
        save(f"denoise{'-pugan' if file else ''}", command, columns, rows)
        save(f"noise-level{'-pugan' if file else ''}", command, quartiles, levels)


if __name__ == "__main__":
    main()
