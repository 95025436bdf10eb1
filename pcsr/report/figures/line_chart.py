"""Line charts with a band for the spread."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.files import write_bytes
from pcsr.report.colours import INK, LINE, SERIES, SOFT
from pcsr.report.figures.canvas import encoded, label, new_figure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 7.6, 4.4
"""Inches; a long legend makes the chart higher."""
BAND = 0.18
"""Opacity of a spread."""
MARKERS = "osD^vP"
LINE_STYLES = ("-", "--", ":", "-.")
"""Styles of the lines: the next one each time that the colours repeat."""

Number = float | int
Line = tuple[Sequence[Number], Sequence[Number] | None]
"""Mean and spread at each x. A mean of NaN is a missing value; a spread of NaN is 0."""


def line_chart(
    title: str,
    x_label: str,
    y_label: str,
    x: Sequence[Number | str],
    lines: Mapping[str, Line],
    path: Path,
) -> None:
    """Draw lines over a common x as a PNG file, each with a band of its mean ± its spread.

    Args:
        title: title of the chart.
        x_label: label of the horizontal axis, with its unit.
        y_label: label of the vertical axis, which begins at 0 unless a value is below it, with its unit.
        x: numbers, or names, which are set side by side in the order given.
        lines: lines by name, in the order of the legend. Missing values are skipped.
        path: path of the file, which is written whole or not at all.

    Raises:
        UserError: there is no x or no line, a line has other than one number for each x or no finite one, or the
            extra `[report]` is not installed.
        RunError: the file can't be written.
    """
    write_bytes(path, encoded(draw_lines(title, x_label, y_label, x, lines), "png"))


def draw_lines(
    title: str,
    x_label: str,
    y_label: str,
    x: Sequence[Number | str],
    lines: Mapping[str, Line],
    colours: Sequence[str] = SERIES,
    *,
    logarithmic: bool = False,
) -> "Figure":
    """The figure that `line_chart` writes.

    Args:
        title: as for `line_chart`.
        x_label: as for `line_chart`.
        y_label: as for `line_chart`.
        x: as for `line_chart`.
        lines: as for `line_chart`.
        colours: colours of the lines, repeated if there are fewer.
        logarithmic: use a logarithmic vertical axis that fits the values, where all are above 0.
    """
    _check(title, x, lines)
    names = any(isinstance(one, str) for one in x)
    across = np.arange(len(x), dtype=float) if names else np.array(x, dtype=float)
    order = np.argsort(across, kind="stable")
    figure = new_figure(WIDTH, max(HEIGHT, 1.0 + 0.21 * len(lines)), layout="constrained")
    axes = figure.add_subplot()
    lowest = 0.0
    handles = []
    for k, line in enumerate(lines.values()):
        mean, spread = _curve(line, order)
        lowest = min(lowest, float(np.nanmin(mean - spread)))
        handles.append(_draw_line(axes, across[order], mean, spread, k, colours[k % len(colours)]))
    if logarithmic and all(np.nanmin(line.get_ydata()) > 0 for line in axes.lines):
        _scale_logarithmically(axes)
    else:
        axes.set_ylim(bottom=lowest if lowest < 0 else 0)
    if names:
        axes.set_xticks(across, [label(str(name), max(6, 72 // len(x)), 3) for name in x])
        axes.set_xlim(-0.5, len(x) - 0.5)
    elif len(own := np.unique(across)) <= 8 and (len(own) == 1 or np.diff(own).min() > 0.06 * np.ptp(own)):
        axes.set_xticks(own, [f"{value:.6g}" for value in own])
    axes.set_title(label(title, 96), fontsize=11, loc="left", color=INK)
    axes.set_xlabel(label(x_label, 80), color=INK)
    axes.set_ylabel(label(y_label, 50), color=INK)
    axes.grid(axis="y", color=LINE, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=SOFT, labelsize=9)
    for side, spine in axes.spines.items():
        spine.set_color(SOFT)
        spine.set_visible(side in ("left", "bottom"))
    figure.legend(handles, [label(name, 30) for name in lines], loc="outside right upper", frameon=False, fontsize=9)
    return figure


def _draw_line(
    axes: "Axes",
    x: Float[np.ndarray, " n"],
    mean: Float[np.ndarray, " n"],
    spread: Float[np.ndarray, " n"],
    k: int,
    colour: str,
) -> "Artist":
    """Draw the k-th line past its missing values, with its spread; the artist for the legend."""
    there = np.isfinite(mean)
    x, mean, spread = x[there], mean[there], spread[there]
    if spread.any() and len(x) > 1:
        axes.fill_between(x, mean - spread, mean + spread, color=colour, alpha=BAND, linewidth=0)
    elif spread.any():
        axes.errorbar(x, mean, spread, color=colour, capsize=6)
    style, marker = LINE_STYLES[k // len(SERIES) % len(LINE_STYLES)], MARKERS[k % len(MARKERS)]
    (handle,) = axes.plot(x, mean, color=colour, linestyle=style, linewidth=1.8, marker=marker, markersize=5)
    return handle


def _scale_logarithmically(axes: "Axes") -> None:
    """Make the vertical axis logarithmic; within a factor of 10 its numbers are evenly spaced."""
    from matplotlib import ticker

    axes.set_yscale("log")
    low, high = axes.get_ylim()
    if high < 10 * low:
        axes.yaxis.set_major_locator(ticker.MaxNLocator(6))
        axes.yaxis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_locator(ticker.NullLocator())


def _check(title: str, x: Sequence[Number | str], lines: Mapping[str, Line]) -> None:
    if not x or not lines:
        raise UserError(f"chart '{title}': there is no {'x' if lines else 'line'}: nothing can be drawn")
    if not any(isinstance(one, str) for one in x) and not np.isfinite(np.array(x, dtype=float)).all():
        raise UserError(f"chart '{title}': an x is not finite: {list(x)}")
    for name, (mean, spread) in lines.items():
        for what, values in (("means", mean), ("spreads", spread)):
            if values is not None and len(values) != len(x):
                raise UserError(
                    f"chart '{title}': line '{name}' has {len(values)} {what} for {len(x)} x: give one each"
                )
        if np.isinf(mean).any() or np.isnan(mean).all() or (spread is not None and np.isinf(spread).any()):
            raise UserError(f"chart '{title}': line '{name}' is not finite: {list(mean)}")
        if spread is not None and (np.array(spread, dtype=float) < 0).any():
            raise UserError(f"chart '{title}': line '{name}' has a spread below 0: {list(spread)}")


def _curve(line: Line, order: np.ndarray) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    mean = np.array(line[0], dtype=float)[order]
    spread = np.zeros(len(mean)) if line[1] is None else np.nan_to_num(np.array(line[1], dtype=float)[order])
    return mean, spread
