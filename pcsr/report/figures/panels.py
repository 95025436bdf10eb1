"""Grid of square panels with captions, a title, and the scale of the error colours."""

import string
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pcsr.report.colours import INK, SOFT
from pcsr.report.figures.canvas import error_bar, label, new_figure
from pcsr.report.figures.clouds import Camera, Layer, draw_clouds

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAP, CAPTION, TITLE, BAR = 0.12, 0.36, 0.4, 0.62
"""Inches: space between panels, height of a caption, of the title, and of the error scale."""


@dataclass(frozen=True)
class Panel:
    """Clouds, and optionally a part of them close up in a second square beside."""

    caption: str
    view: Camera
    layers: Sequence[Layer]
    close: Camera | None = None
    close_layers: Sequence[Layer] = field(default=())


def panel_figure(
    title: str, rows: Sequence[Sequence[Panel]], size: float, end: float | None = None, *, below: float = 0.0
) -> "Figure":
    """Figure of panels in rows.

    Args:
        title: title of the figure.
        rows: panels, all with or all without a close-up; a row may be shorter than the first.
        size: side of a square, in inches.
        end: error at the end of the colour scale, ×10⁻³ radii of the object; None: no scale is shown.
        below: height of an empty strip at the bottom, in inches.
    """
    squares = 1 if rows[0][0].close is None else 2
    wide = squares * size
    width = GAP + max(map(len, rows)) * (wide + GAP)
    height = TITLE + len(rows) * (CAPTION + size + GAP) + (below if end is None else BAR)
    figure = new_figure(width, height)
    figure.text(GAP / width, 1 - 0.22 / height, label(title, int(11 * width), 1), fontsize=12, color=INK, va="center")
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            left, top = GAP + j * (wide + GAP), height - TITLE - i * (CAPTION + size + GAP)
            caption = label(panel.caption, int(13 * wide))
            figure.text(left / width, (top - CAPTION + 0.05) / height, caption, fontsize=8, color=SOFT, va="bottom")
            bottom, square = (top - CAPTION - size) / height, (size / width, size / height)
            axes = figure.add_axes((left / width, bottom, *square))
            draw_clouds(axes, size, panel.view, panel.layers)
            if panel.close is not None:
                x, y, _ = panel.view.seen(panel.close.centre[None])[0]
                half = panel.close.half
                corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
                axes.plot(*zip(*((x + half * a, y + half * b) for a, b in corners), strict=True), color=INK, lw=1)
                beside = figure.add_axes(((left + size) / width, bottom, *square))
                draw_clouds(beside, size, panel.close, panel.close_layers)
    if end is not None:
        bounds = (2 * GAP / width, (BAR - 0.14) / height, min(3.0, width / 2) / width, 0.1 / height)
        error_bar(figure, bounds, end, "distance to the nearest true point, ×10⁻³ radii of the object")
    return figure


def letter(k: int) -> str:
    """The k-th letter: a to z, then aa, ab and so on."""
    letters = string.ascii_lowercase
    return letters[k] if k < len(letters) else letters[k // len(letters) - 1] + letters[k % len(letters)]
