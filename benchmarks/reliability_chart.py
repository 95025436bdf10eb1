"""The reliability plot of docs/confidence.md: expected errors beside the true ones, bin by bin."""

from collections.abc import Sequence
from pathlib import Path

from pcsr.files import write_bytes
from pcsr.report.colours import INK, LINE, SERIES, SOFT
from pcsr.report.figures.canvas import encoded, new_figure

BINS = 10
COLUMNS = ("clouds", "model", "bin", "points", "expected error", "true error, 68 %", "within, %", "± %")
MARKERS = "osD^"
ACROSS = 3
"""Number of panels in a row."""
LEAST = 1e-3
"""Smallest error that is drawn, in units of the largest one of its panel."""


def draw(rows: Sequence[Sequence[str]], path: Path) -> None:
    """Draw a panel for each kind of cloud as a PNG file.

    Args:
        rows: rows with `COLUMNS`.
        path: path of the file, which is written whole or not at all.
    """
    kinds, models = (list(dict.fromkeys(row[column] for row in rows)) for column in (0, 1))
    down = -(-len(kinds) // ACROSS)
    figure = new_figure(3.1 * min(ACROSS, len(kinds)), 3.3 * down + 0.3, layout="constrained")
    grid = figure.subplots(down, min(ACROSS, len(kinds)), squeeze=False)
    for axes, kind in zip(grid.flat, kinds, strict=False):
        of_kind = [row for row in rows if row[0] == kind]
        most = max(float(row[column]) for row in of_kind for column in (4, 5)) * 1.5
        ends = LEAST * most, most
        axes.fill_between(ends, [end / 1.25 for end in ends], [end * 1.25 for end in ends], color=LINE, linewidth=0)
        axes.plot(ends, ends, color=SOFT, linewidth=0.8)
        for number, model in enumerate(models):
            points = [(float(row[4]), float(row[5])) for row in of_kind if row[1] == model]
            if not points:
                continue
            x, y = zip(*((max(one, ends[0]), max(other, ends[0])) for one, other in points), strict=True)
            axes.plot(x, y, marker=MARKERS[number], markersize=4, linewidth=1, color=SERIES[number], label=model)
        axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
        axes.set_title(kind, fontsize=8, color=INK)
        axes.tick_params(labelsize=7)
    for axes in list(grid.flat)[len(kinds) :]:
        axes.set_axis_off()
    figure.supxlabel("expected error of a tenth of the new points (median)", fontsize=9)
    figure.supylabel("68 % of them are closer to the surface", fontsize=9)
    grid[0][0].legend(fontsize=8, frameon=False)
    write_bytes(path, encoded(figure, "png"))
