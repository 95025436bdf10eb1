"""Matplotlib figures without pyplot: construction, encoding as images, text and colours."""

import textwrap
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float

from pcsr.extras import imported
from pcsr.report.colours import ERROR_SCALE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100
USER = "a figure"
"""Reason for the need of matplotlib, in the message if it is not installed."""


def new_figure(width: float, height: float, **options: Any) -> "Figure":
    """Empty figure with an Agg canvas, on white.

    Args:
        width: in inches.
        height: in inches.
        options: further arguments of `matplotlib.figure.Figure`.

    Raises:
        UserError: the extra `[report]` is not installed.
    """
    figure: Figure = imported("matplotlib.figure", USER).Figure((width, height), DPI, facecolor="white", **options)
    imported("matplotlib.backends.backend_agg", USER).FigureCanvasAgg(figure)
    return figure


def encoded(figure: "Figure", form: Literal["png", "webp"]) -> bytes:
    """Image file of a figure, with no date and no version in it: equal figures give equal bytes.

    Args:
        figure: from `new_figure`.
        form: "png" is lossless; "webp" is not, and a quarter of the size.
    """
    file = BytesIO()
    canvas: Any = figure.canvas
    if form == "png":
        canvas.print_png(file, metadata={"Software": None})
    else:
        canvas.print_webp(file, pil_kwargs={"quality": 85})
    return file.getvalue()


def label(text: str, width: int, lines: int = 2) -> str:
    """Text for a figure, wrapped, cut after some lines, and without the meaning that matplotlib gives to `$`.

    Args:
        text: any text.
        width: characters in a line.
        lines: largest number of lines; a longer text ends in "…".
    """
    return textwrap.fill(text, width, max_lines=lines, placeholder="…").replace("$", r"\$")


def error_colours(errors: Float[np.ndarray, " n"], end: float) -> Float[np.ndarray, "n 3"]:
    """Colours of errors on the report's scale from 0 to `end`; errors beyond have the last colour."""
    return np.asarray(_error_map()(errors / end), dtype=float)[:, :3]


def error_bar(figure: "Figure", bounds: tuple[float, float, float, float], end: float, text: str) -> None:
    """Add the scale of `error_colours` as a horizontal colour bar.

    Args:
        figure: the figure.
        bounds: left, bottom, width and height, as fractions of the figure.
        end: error at the end of the scale.
        text: label of the scale.
    """
    norm = imported("matplotlib.colors", USER).Normalize(0, end)
    mappable = imported("matplotlib.cm", USER).ScalarMappable(norm, _error_map())
    axes = figure.add_axes(bounds)
    bar = figure.colorbar(mappable, cax=axes, orientation="horizontal", extend="max")
    bar.ax.tick_params(labelsize=8)
    bar.set_label(text, fontsize=8, loc="left")


def _error_map() -> Any:
    return imported("matplotlib.colors", USER).LinearSegmentedColormap.from_list("errors", ERROR_SCALE)
