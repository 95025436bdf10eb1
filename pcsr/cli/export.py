"""`pcsr export`: a network as an ONNX graph."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE


class _Batch(click.IntRange):
    """How many clouds at once: a number, or any."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """A positive number, or the word `dynamic`."""
        return value if value == "dynamic" else super().convert(value, param, ctx)


@click.command()
@click.argument("model")
@click.option("-o", "--out", type=FILE, required=True, metavar="OUT", help="The file to write, such as model.onnx.")
@click.option("--touches", type=click.IntRange(0), default=0, show_default=True, help="Touches of each cloud.")
@click.option("--points", type=click.IntRange(1), default=None, help="Points of a cloud.  [default: as in training]")
@click.option(
    "--touch-points", type=click.IntRange(1), default=None, help="Points of each touch.  [default: as in training]"
)
@click.option(
    "--batch",
    type=_Batch(1),
    default="dynamic",
    show_default=True,
    metavar="N",
    help="Clouds at once, or dynamic: any.",
)
@click.option("--plugin", "plugins", multiple=True, type=FILE, metavar="FILE", help="Parts that the weights need.")
def export(
    model: str,
    out: Path,
    touches: int,
    points: int | None,
    touch_points: int | None,
    batch: int | str,
    plugins: tuple[Path, ...],
) -> None:
    """Write a network as ONNX.

    MODEL is a name, a run folder or a weights file. The graph's inputs are the points and, if there are any, the
    touches, both in the unit sphere of the points; its output is the dense cloud. It needs the extra [onnx].
    """
    from pcsr.export import export_onnx
    from pcsr.library import load

    loaded = load(model, plugins=plugins)
    shapes = export_onnx(
        loaded,
        out,
        points=points,
        touches=touches,
        touch_points=touch_points,
        batch=None if isinstance(batch, str) else batch,
    )
    ways = [f"{name} ({' '.join(map(str, shape))})" for name, shape in shapes.items()]
    click.echo(f"{out}: {', '.join(ways[:-1])} to {ways[-1]}, {out.stat().st_size / 1e6:.1f} MB", err=True)
