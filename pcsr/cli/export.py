"""`pcsr export`: a network as an ONNX graph, or its weights as a file to hand on."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, PLUGIN
from pcsr.errors import UserError

POINTS = click.IntRange(1, 1 << 20)
"""The type of numbers of points that a graph is made for."""


class _Batch(click.IntRange):
    """How many clouds at once: a number, or any."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """A positive number, or the word `dynamic`."""
        return value if value == "dynamic" else super().convert(value, param, ctx)


@click.command()
@click.argument("model")
@click.option(
    "-o", "--out", type=FILE, required=True, metavar="OUT", help="The file to write: model.onnx, weights.safetensors."
)
@click.option("--touches", type=click.IntRange(0, 1024), default=0, show_default=True, help="Touches of each cloud.")
@click.option("--points", type=POINTS, default=None, help="Points of a cloud.  [default: as in training]")
@click.option(
    "--touch-points",
    type=POINTS,
    default=None,
    help="Points of each touch.  [default: as in training]",
)
@click.option(
    "--batch",
    type=_Batch(1, 1024),
    default="dynamic",
    show_default=True,
    metavar="N",
    help="Clouds at once, or dynamic: any.",
)
@click.option("--half", is_flag=True, help="Weights in half precision, in half the space.")
@click.option("--plugin", "plugins", multiple=True, type=PLUGIN, metavar="FILE", help="Parts that the weights need.")
def export(
    model: str,
    out: Path,
    touches: int,
    points: int | None,
    touch_points: int | None,
    batch: int | str,
    half: bool,
    plugins: tuple[Path, ...],
) -> None:
    """Write a network as ONNX, or its weights.

    MODEL is a name, a run folder or a weights file. The graph's inputs are the points and, if there are any, the
    touches, both in the unit sphere of the points; its output is the dense cloud. It needs the extra [onnx].

    Where OUT ends in .safetensors, the weights and their card are written, to be shipped or put on a hub.
    """
    from pcsr.export import export_onnx, export_weights
    from pcsr.model import load

    if out.suffix == ".safetensors":
        _refuse_sizes()
        export_weights(load(model, plugins=plugins), out, half=half)
        click.echo(f"{out}: weights{' in half precision' if half else ''}, {_size(out)}", err=True)
        return
    if half:
        raise UserError(f"--half is for weights, and {out} is none: name a file OUT.safetensors, or leave --half out")
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
    click.echo(f"{out}: {', '.join(ways[:-1])} to {ways[-1]}, {_size(out)}", err=True)


def _refuse_sizes() -> None:
    """Options of graphs mean nothing to weights."""
    context = click.get_current_context()
    for name in ("touches", "points", "touch_points", "batch"):
        if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            option = name.replace("_", "-")
            raise UserError(f"--{option} is for ONNX graphs, and weights serve clouds of any size: leave it out")


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
