"""`pcsr evaluate`: every metric of a cloud beside the truth."""

import json
from pathlib import Path

import click

from pcsr.cli.options import FILE, PLUGIN


@click.command()
@click.argument("prediction", type=FILE)
@click.argument("truth", type=FILE)
@click.option("--mesh", type=FILE, default=None, help="The true surface, for the metrics that need it.")
@click.option(
    "--frame",
    type=click.Choice(["truth", "each", "none"]),
    default="truth",
    show_default=True,
    help="truth: the truth fills the unit sphere; each: each cloud fills its own, as in most papers; none: as it is.",
)
@click.option("--metric", "metrics", multiple=True, help="Which; by default all that can be measured.")
@click.option("--plugin", "plugins", multiple=True, type=PLUGIN, metavar="FILE", help="A Python file with metrics.")
@click.option("--json", "plain", is_flag=True, help="Print JSON, unscaled.")
def evaluate(
    prediction: Path,
    truth: Path,
    mesh: Path | None,
    frame: str,
    metrics: tuple[str, ...],
    plugins: tuple[Path, ...],
    plain: bool,
) -> None:
    """Measure a cloud beside the true one."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from pcsr.clouds.formats import read_points
    from pcsr.clouds.formats.mesh import read_mesh
    from pcsr.metrics.one_cloud import evaluate as measure
    from pcsr.metrics.one_cloud import named, why_no_emd

    clouds = read_points(prediction), read_points(truth)
    surface = None if mesh is None else read_mesh(mesh)
    values = measure(*clouds, surface, frame=frame, metrics=metrics or None, plugins=plugins)
    if not metrics and (why := why_no_emd(*map(len, clouds))):
        click.echo(f"left out: {why}", err=True)
    if plain:
        click.echo(json.dumps(values))
        return
    table = Table("metric", "value", "what it is", box=box.SIMPLE_HEAD, caption=_frame(frame))
    for name, metric in named(list(values), plugins).items():
        value = values[name]
        table.add_row(name, f"{value * metric.scale:.4g} ×10⁻³", metric.description)
    Console().print(table)


def _frame(frame: str) -> str:
    return {
        "truth": "Both clouds in the frame in which the truth fills the unit sphere. Lower is better.",
        "each": "Each cloud fills the unit sphere; p2f in the mesh's unit. Lower is better.",
        "none": "In the clouds' own unit. Lower is better.",
    }[frame]
