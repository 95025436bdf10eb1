"""`pcsr evaluate`: the metrics of a cloud against the true one."""

import json
from pathlib import Path

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, PLUGIN, columns_option, complete_metric
from pcsr.errors import UserError


@click.command()
@click.argument("prediction", type=FILE)
@click.argument("truth", type=FILE)
@click.option(
    "--mesh",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Mesh of the true surface, in the frame and unit of TRUTH, for metrics that need it, such as p2f.",
)
@click.option(
    "--frame",
    type=click.Choice(["truth", "each", "none"]),
    default="truth",
    show_default=True,
    help="Normalisation. truth: both clouds by the bounding sphere of TRUTH; each: each cloud by its own, as in most "
    "papers; none: no normalisation.",
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
@columns_option
@click.option("--plugin", "plugins", multiple=True, type=PLUGIN, metavar="FILE", help="Python file with metrics.")
@click.option("--json", "plain", is_flag=True, help="Print the unscaled values as JSON.")
def evaluate(
    prediction: Path,
    truth: Path,
    mesh: Path | None,
    frame: str,
    metrics: tuple[str, ...],
    suffix: str | None,
    columns: str | None,
    plugins: tuple[Path, ...],
    plain: bool,
) -> None:
    """Measure a cloud against the true one.

    PREDICTION and TRUTH are files of clouds, in any format that pcsr upsample reads. A warning says so if one of them
    is more than 3 times as large as the other, as in another unit.
    """
    from rich import box
    from rich.table import Column, Table

    from pcsr.clouds.formats import TEXT_READERS, read_points
    from pcsr.clouds.formats.format_table import format_of, named_by
    from pcsr.clouds.meshes import read_mesh
    from pcsr.metrics.one_cloud import evaluate as measure
    from pcsr.metrics.one_cloud import named, why_no_emd

    files = [(path, None if named_by(path) else suffix) for path in (prediction, truth)]
    if suffix is not None and not any(chosen for _, chosen in files):
        raise UserError(f"--format {suffix[:80]}: the suffixes of both clouds name their formats: leave it out")
    if columns is not None and not any(format_of(path, chosen) in TEXT_READERS for path, chosen in files):
        raise UserError(f"--columns {columns[:200]}: neither cloud is text, whose columns it could name")
    judged, true = (read_points(path, chosen, columns=columns) for path, chosen in files)
    surface = None if mesh is None else read_mesh(mesh)
    values = measure(judged, true, surface, frame=frame, metrics=metrics or None, plugins=plugins)
    if not metrics and (why := why_no_emd(len(judged), len(true))):
        click.echo(f"skipped: {why}", err=True)
    if plain:
        click.echo(json.dumps(values))
        return
    heads = (Column(head, overflow="fold") for head in ("metric", "value", "description"))
    table = Table(*heads, box=box.SIMPLE_HEAD, caption=_frame(frame))
    for name, metric in named(list(values), plugins).items():
        value = values[name]
        table.add_row(name, f"{value * metric.scale:.4g} ×10⁻³", metric.description)
    streams.console().print(table)


def _frame(frame: str) -> str:
    return {
        "truth": "Both clouds are normalised by the bounding sphere of the truth. Lower is better.",
        "each": "Each cloud is normalised by its own bounding sphere; p2f is in the mesh's unit. Lower is better.",
        "none": "Values are in the unit of the clouds. Lower is better.",
    }[frame]
