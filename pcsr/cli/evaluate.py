"""`pcsr evaluate`: the metrics of a cloud against the true one."""

import json
from pathlib import Path

import click

from pcsr.cli.options import FILE, PLUGIN, complete_metric
from pcsr.errors import UserError


@click.command()
@click.argument("prediction", type=FILE)
@click.argument("truth", type=FILE)
@click.option(
    "--mesh", type=FILE, default=None, metavar="FILE", help="Mesh of the true surface, for metrics that need it."
)
@click.option(
    "--frame",
    type=click.Choice(["truth", "each", "none"]),
    default="truth",
    show_default=True,
    help="Normalization. truth: both clouds by the bounding sphere of TRUTH; each: each cloud by its own, as in most "
    "papers; none: no normalization.",
)
@click.option(
    "--metric",
    "metrics",
    multiple=True,
    metavar="NAME",
    shell_complete=complete_metric,
    help="Compute only this metric. May be repeated.  [default: all that are possible]",
)
@click.option(
    "--format",
    "suffix",
    default=None,
    help="Format of the clouds whose suffix names none, such as .bin: kitti, nuscenes, colmap, ply …",
)
@click.option("--plugin", "plugins", multiple=True, type=PLUGIN, metavar="FILE", help="Python file with metrics.")
@click.option("--json", "plain", is_flag=True, help="Print the unscaled values as JSON.")
def evaluate(
    prediction: Path,
    truth: Path,
    mesh: Path | None,
    frame: str,
    metrics: tuple[str, ...],
    suffix: str | None,
    plugins: tuple[Path, ...],
    plain: bool,
) -> None:
    """Measure a cloud against the true one.

    PREDICTION and TRUTH are files of clouds, in any format that `pcsr upsample` reads. A warning says so if one of them
    is 5 times larger than the other or more, as in another unit.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from pcsr.clouds.formats import read_points
    from pcsr.clouds.formats.format_table import named_by
    from pcsr.clouds.meshes import read_mesh
    from pcsr.metrics.one_cloud import evaluate as measure
    from pcsr.metrics.one_cloud import named, why_no_emd
    from pcsr.metrics.units import warn_of_units

    chosen, true = (None if named_by(path) else suffix for path in (prediction, truth))
    if suffix is not None and chosen is None and true is None:
        raise UserError(f"--format {suffix[:80]}: the suffixes of both clouds name their formats: leave it out")
    clouds = read_points(prediction, chosen), read_points(truth, true)
    surface = None if mesh is None else read_mesh(mesh)
    values = measure(*clouds, surface, frame=frame, metrics=metrics or None, plugins=plugins)
    warn_of_units(clouds[0], str(prediction), clouds[1], str(truth))
    if surface is not None:
        warn_of_units(surface.vertices, str(mesh), clouds[1], str(truth))
    if not metrics and (why := why_no_emd(*map(len, clouds))):
        click.echo(f"skipped: {why}", err=True)
    if plain:
        click.echo(json.dumps(values))
        return
    table = Table("metric", "value", "description", box=box.SIMPLE_HEAD, caption=_frame(frame))
    for name, metric in named(list(values), plugins).items():
        value = values[name]
        table.add_row(name, f"{value * metric.scale:.4g} ×10⁻³", metric.description)
    Console().print(table)


def _frame(frame: str) -> str:
    return {
        "truth": "Both clouds are normalized by the bounding sphere of the truth. Lower is better.",
        "each": "Each cloud is normalized by its own bounding sphere; p2f is in the mesh's unit. Lower is better.",
        "none": "Values are in the unit of the clouds. Lower is better.",
    }[frame]
