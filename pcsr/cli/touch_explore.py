"""`pcsr touch explore`: touch a mesh in simulation, upsample, and compare policies by the error over the touches."""

from math import nan
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, complete_part, complete_weights, plugin_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.plugins.registry import Registry


@click.command()
@click.argument("mesh", type=FILE)
@click.option(
    "--policy",
    "policies",
    multiple=True,
    default=("expected-error", "sparse", "uniform"),
    show_default=True,
    metavar="NAME",
    shell_complete=complete_part("policy"),
    help="Policy to compare. May be repeated.",
)
@click.option(
    "--count", type=click.IntRange(1, 16), default=5, show_default=True, metavar="N", help="Number of touches."
)
@click.option("--sensor", default="digit", show_default=True, metavar="NAME", help="Preset of the sensor.")
@click.option(
    "--object-size",
    default="60",
    show_default=True,
    metavar="MM",
    help="Longest side of the object in mm; null if the mesh is in mm.",
)
@click.option(
    "--points",
    type=click.IntRange(64, 65_536),
    default=512,
    show_default=True,
    metavar="N",
    help="Points of the cloud.",
)
@click.option("--one-side", is_flag=True, help="Let one camera see the object, so that a side is hidden.")
@click.option(
    "--candidates",
    type=click.IntRange(1, 10_000),
    default=None,
    metavar="N",
    help="Points of the surface at which poses are tried.  [default: 160]",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Seed of cloud and touches."
)
@click.option("--model", default=None, metavar="NAME", shell_complete=complete_weights, help="Model.  [default: field]")
@click.option(
    "-o", "--out", type=FILE, default=None, metavar="FILE", help="Draw the error over the touches: a .png file."
)
@plugin_option
def explore(
    mesh: Path,
    policies: tuple[str, ...],
    count: int,
    sensor: str,
    object_size: str,
    points: int,
    one_side: bool,
    candidates: int | None,
    seed: int,
    model: str | None,
    out: Path | None,
    registry: "Registry",
) -> None:
    """Touch a mesh in simulation, upsample its cloud with the touches so far, and touch again.

    MESH is a file of a mesh. Each touch is at the first pose of pcsr touch next where the finger can touch; the
    policies know the cloud and the touches so far, not the mesh. The table has the Chamfer distance to the true surface
    after each touch, for each policy, and the number of poses at which the finger failed.

    \b
    pcsr touch explore part.stl --object-size 30 -o explore.png
    pcsr touch explore part.stl --plugin my_policy.py --policy my-policy --policy sparse
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.exploration.next import CANDIDATES
    from pcsr.exploration.over_touches import Setting, errors_over_touches
    from pcsr.extras import require
    from pcsr.files import check_target
    from pcsr.model import load
    from pcsr.progress import progress_bars

    if not mesh.is_file():
        raise UserError(f"mesh {mesh}: {'that is a folder' if mesh.is_dir() else 'there is no such file'}")
    if out is not None:
        if out.suffix.lower() != ".png":
            raise UserError(f"-o {out}: the chart is written as .png: name such a file")
        require({"matplotlib": "a figure"})
        check_target(out)
    names = list(dict.fromkeys(policies))
    for name in names:
        registry.get("policy", name)
    tries = CANDIDATES if candidates is None else candidates
    setting = Setting(mesh, count, sensor, object_size, points, one_side, tries, seed)
    with progress_bars(streams.console(error=True), hidden=False) as progress:
        task = progress.add_task("touches", total=len(names) * count)
        found = errors_over_touches(setting, names, load(model), registry, lambda: progress.advance(task))
    width = max(7, *map(len, names))
    click.echo(f"{'touches':{width}}  " + "  ".join(f"{number:>7}" for number in range(count + 1)) + "   failed")
    for name, one in found.items():
        cells = [f"{error:7.4f}" for error in one.errors] + [" " * 7] * (count + 1 - len(one.errors))
        click.echo(f"{name:{width}}  " + "  ".join(cells) + f"  {one.failed:7}")
    click.echo("Chamfer distance to the true surface, mm²; failed: poses where the finger could not touch")
    if out is not None:
        from pcsr.report.figures.line_chart import line_chart

        lines = {name: (one.errors + [nan] * (count + 1 - len(one.errors)), None) for name, one in found.items()}
        line_chart(mesh.name, "touches", "Chamfer distance, mm²", list(range(count + 1)), lines, out)
        click.echo(str(out))
