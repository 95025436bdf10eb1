"""PU-GAN's test shapes: 4x from 2048 points and 16x from 512, beside interpolation (the tables of docs/accuracy.md).

python benchmarks/pugan.py pugan21.npz [MODEL…] [--touches 4] [--size 60] [--first 5] [--save]

The file holds, for each shape, `input_512`, `input_2048` and `gt_8192` (independent Poisson-disk samples) and the mesh.
Measured are interpolation and the shipped weights, or the models that are named. Models of any rate without `patches`
are measured through `Model.upsample`, as users get them; the others as their recipe is evaluated, by patches or the
whole cloud in one pass. The column `protocol` says which. A network that cannot make a rate is not in that table.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
import trimesh
from jaxtyping import Float
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from saved import save
from scipy.spatial import cKDTree

import pcsr
from pcsr import weights
from pcsr.contracts import ShapeItem, Trait
from pcsr.errors import PcsrError, PcsrWarning, UserError
from pcsr.geometry.interpolation import midpoint
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe
from pcsr.upsample import protocol, upsample_as
from pcsr.upsample.protocol import IN_USE

INPUTS = {4: "input_2048", 16: "input_512"}
METRICS = ("cd", "hd-pugcn", "p2f")
SHIFTED = "cd, truth's frame"
"""A cloud that fills the unit sphere by itself does not show that it is shifted, or too large, and its outliers
shift and shrink all of it."""
SPACING = "spacing CV"
"""Coefficient of variation of the distances to the nearest neighbour; 0 for a regular grid."""
SEED = 0
Cloud = Float[np.ndarray, "_ 3"]


@dataclass(frozen=True)
class Method:
    """A row of the table."""

    protocol: str
    upsample: Callable[[Cloud, Sequence[Cloud]], Cloud]
    """Function of the sparse cloud and the touches that returns the dense cloud."""


@dataclass(frozen=True)
class Shape:
    """All in the mesh's frame and unit."""

    name: str
    mesh: trimesh.Trimesh
    sparse: dict[int, Cloud]
    """The cloud to upsample, by the rate."""
    truth: Cloud
    touches: tuple[Cloud, ...] = ()


def read(path: Path) -> list[Shape]:
    """The shapes of the file."""
    data = np.load(path)
    return [
        Shape(
            str(name),
            trimesh.Trimesh(data[f"vertices_{name}"], data[f"faces_{name}"], process=False),
            {rate: data[key][k].astype(np.float64) for rate, key in INPUTS.items()},
            data["gt_8192"][k],
        )
        for k, name in enumerate(data["names"])
    ]


def touched(shapes: Sequence[Shape], source: pcsr.TouchSource, count: int) -> list[Shape]:
    """The shapes with `count` touches each; one that cannot be touched is left out, and stderr says why.

    Raises:
        UserError: no shape is left.
    """
    kept = []
    for shape in shapes:
        try:  # touches are drawn uniformly from the surface whatever the cloud is, so both rates have the same touches
            touches = source.touches(ShapeItem(shape.name, shape.name, shape.mesh), shape.sparse[4], count, SEED)
        except UserError as error:
            click.echo(f"{shape.name} is left out, as it cannot be touched: {error}", err=True)
            continue
        kept.append(replace(shape, touches=tuple(touch.points for touch in touches)))
    if not kept:
        raise UserError(f"none of {len(shapes)} shapes can be touched {count} times: give another --size, or fewer")
    return kept


def trained(model: pcsr.Model) -> tuple[Network, Recipe]:
    """The model's network and what it was trained by.

    Raises:
        UserError: the model has no network.
    """
    if model.network is None or model.recipe is None:
        raise UserError(f"model '{model.name}' has no network: interpolation is measured anyway, so leave it out")
    return model.network, model.recipe


def serves(network: Network, recipe: Recipe, rate: int) -> bool:
    """Whether the network, applied as in its own tables, can make `rate` points of each."""
    if recipe.patches:  # the network is applied again to what it made
        return rate in (recipe.patches.rate**times for times in range(1, rate))
    return rate == recipe.network_rate or Trait.ANY_RATE in network.upsampler.traits


def methods(models: Sequence[pcsr.Model], rate: int, touches: int) -> dict[str, Method]:
    """What is compared at a rate: interpolation, and each model without touches and, if it was trained with any, with.

    Raises:
        UserError: a model has no network.
    """
    compared = {"midpoint": in_use(pcsr.load("midpoint"), rate, touched=False), "midpoint, whole cloud": whole(rate)}
    for model in models:
        network, recipe = trained(model)
        if not serves(network, recipe, rate):
            click.echo(f"{model.name} cannot make {rate}x and is not in that table", err=True)
            continue
        compared[model.name] = by_protocol(model, rate, touched=False)
        if touches and recipe.most_touches:
            name = f"{model.name}, {touches} touch{'es' if touches > 1 else ''}"
            compared[name] = by_protocol(model, rate, touched=True)
    return compared


def by_protocol(model: pcsr.Model, rate: int, *, touched: bool) -> Method:
    """How a network is used or, if it has one rate or patches, evaluated; with a shape's touches or without."""
    network, recipe = trained(model)
    recipe = recipe.model_copy(update={"data": recipe.data.model_copy(update={"rate": rate})})
    name = protocol(recipe, network)
    if name == IN_USE:
        return in_use(model, rate, touched=touched)
    return Method(name, lambda points, touches: upsample_as(recipe, network, points, touches if touched else ()))


def in_use(model: pcsr.Model, rate: int, *, touched: bool) -> Method:
    """The model as users have it, with a shape's touches or without."""

    def upsample(points: Cloud, touches: Sequence[Cloud]) -> Cloud:
        with warnings.catch_warnings():  # touches of unseen regions are simulated, and thus not misplaced
            warnings.simplefilter("ignore", PcsrWarning)
            dense: Cloud = model.upsample(points, touches if touched else (), rate=rate)
        return dense

    return Method(IN_USE, upsample)


def whole(rate: int) -> Method:
    """Interpolation of the whole cloud, at 16x as 4x twice, as the field does it and as is much better."""
    passes = 2 if rate == 16 else 1
    name = "whole cloud, 4x twice" if passes == 2 else "whole cloud in one pass"
    return Method(name, lambda points, touches: midpoint(points, rate, passes=passes))


def spacing_variation(points: Cloud) -> float:
    """Coefficient of variation of the points' distances to their nearest neighbours."""
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    return float(nearest.std() / nearest.mean())


def scores(dense: Cloud, shape: Shape) -> list[float]:
    """Compute the columns for one cloud: `METRICS` as the field has them and `SHIFTED`, times 10³; and `SPACING`."""
    field = pcsr.evaluate(dense, shape.truth, shape.mesh, frame="each", metrics=METRICS)
    own = pcsr.evaluate(dense, shape.truth, frame="truth", metrics="cd")
    return [*(1e3 * value for value in (*(field[metric] for metric in METRICS), own["cd"])), spacing_variation(dense)]


def table(shapes: Sequence[Shape], compared: dict[str, Method], rate: int, title: str) -> Table:
    """Mean ± sample standard deviation over the shapes, in Markdown."""
    result = Table("method", "protocol", *METRICS, SHIFTED, SPACING, title=title, box=box.MARKDOWN)
    for name, method in compared.items():
        shown = track(shapes, name, console=Console(stderr=True), transient=True)
        rows = [scores(method.upsample(shape.sparse[rate], shape.touches), shape) for shape in shown]
        spread = np.std(rows, 0, ddof=1) if len(rows) > 1 else np.full(len(rows[0]), np.nan)
        result.add_row(
            name, method.protocol, *(f"{m:.3f} ± {s:.3f}" for m, s in zip(np.mean(rows, 0), spread, strict=True))
        )
    return result


@click.command()
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.argument("models", nargs=-1, metavar="[MODEL]...")
@click.option("--touches", type=click.IntRange(0, 16), default=0, help="Also measure with so many simulated touches.")
@click.option(
    "--size",
    type=click.FloatRange(0, min_open=True),
    default=60.0,
    show_default=True,
    help="Longest side of each shape for the touches, in mm.",
)
@click.option("--first", type=click.IntRange(1), help="Only so many of the shapes, as some peers were measured on.")
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/pugan-4x.json and pugan-16x.json.")
def main(file: Path, models: Sequence[str], touches: int, size: float, first: int | None, saving: bool) -> None:
    """Print the tables of the shapes in FILE, for each MODEL (names, run folders, weights) or the shipped weights."""
    try:
        loaded = [pcsr.load(model) for model in models or weights.names()]
        every = read(file)
        shapes = every[:first]
        if touches:
            shapes = touched(shapes, load_plugins().get("touch", "digit")(object_size=size), touches)
        for rate in INPUTS:
            title = f"{rate}x, {len(shapes)} of {len(every)} shapes, distances ×10³"
            found = table(shapes, methods(loaded, rate, touches), rate, title)
            Console(width=1000).print(found)  # a table is as wide as it need be, in a file too
            if saving:
                rows = list(zip(*(column.cells for column in found.columns), strict=True))
                command = f"python benchmarks/pugan.py {file.name} --touches {touches} --save"
                save(f"pugan-{rate}x", command, [str(column.header) for column in found.columns], rows)
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
