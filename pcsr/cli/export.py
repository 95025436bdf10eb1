"""`pcsr export`: write a network as an ONNX graph, or its weights as a safetensors file."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, PLUGIN, complete_weights
from pcsr.errors import UserError

POINTS = click.IntRange(1, 1 << 20)
"""Click type of the number of points in a cloud or touch of the graph's input."""


class _Batch(click.IntRange):
    """Click type of the batch size: a number, or `dynamic`."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or the word `dynamic`."""
        return value if value == "dynamic" else super().convert(value, param, ctx)


@click.command()
@click.argument("model", shell_complete=complete_weights)
@click.option(
    "-o", "--out", type=FILE, required=True, metavar="FILE", help="File to write, ending in .onnx or .safetensors."
)
@click.option(
    "--touches",
    type=click.IntRange(0, 1024),
    default=0,
    show_default=True,
    metavar="N",
    help="Number of touches for each cloud.",
)
@click.option(
    "--points", type=POINTS, default=None, metavar="N", help="Number of points in a cloud.  [default: as in training]"
)
@click.option(
    "--touch-points",
    type=POINTS,
    default=None,
    metavar="N",
    help="Number of points in a touch.  [default: as in training]",
)
@click.option(
    "--batch",
    type=_Batch(1, 1024),
    default="dynamic",
    show_default=True,
    metavar="N",
    help="Batch size, or dynamic for any.",
)
@click.option("--half", is_flag=True, help="Write the weights in half precision, at half the size.")
@click.option(
    "--plugin",
    "plugins",
    multiple=True,
    type=PLUGIN,
    metavar="FILE",
    help="Load parts from this Python file too. May be repeated.",
)
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
    """Export a network to ONNX, or its weights to a file.

    MODEL is the name of weights, a run folder or a weights file.

    If the file's name ends in .safetensors, the weights and their card are written. Otherwise the network is written
    as an ONNX graph. The graph's inputs are the points and, with --touches, the touches; both are normalised by the
    bounding sphere of the points. Its output is the dense cloud. ONNX needs the extra [onnx].
    """
    from pcsr.export import export_onnx, export_weights
    from pcsr.model import load

    if out.suffix == ".safetensors":
        _refuse_sizes()
        export_weights(load(model, plugins=plugins), out, half=half)
        click.echo(f"{out}: weights{' in half precision' if half else ''}, {_size(out)}", err=True)
        return
    if half:
        raise UserError(
            f"--half applies to weights, and {out} is no .safetensors file: change its suffix, or leave --half out"
        )
    loaded = load(model, plugins=plugins)
    shapes = export_onnx(
        loaded,
        out,
        points=points,
        touches=touches,
        touch_points=touch_points,
        batch=None if isinstance(batch, str) else batch,
    )
    *inputs, output = [f"{name} ({' '.join(map(str, shape))})" for name, shape in shapes.items()]
    click.echo(f"{out}: {', '.join(inputs)} to {output}, {_size(out)}", err=True)


def _refuse_sizes() -> None:
    """Refuse options that apply to ONNX graphs only.

    Raises:
        UserError: one was given.
    """
    context = click.get_current_context()
    for name in ("touches", "points", "touch_points", "batch"):
        if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            option = name.replace("_", "-")
            raise UserError(f"--{option} applies to ONNX graphs, and weights fit clouds of any size: leave it out")


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
