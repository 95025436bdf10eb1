"""Line charts of finished runs: validation over the training, and the first metric over the number of touches."""

import math
from typing import TYPE_CHECKING

from pcsr.report.colours import row_colours
from pcsr.report.figures.line_chart import Line, draw_lines
from pcsr.report.run_set import RunSet
from pcsr.report.tables.comparison_tables import VARIED, varied
from pcsr.report.tables.rows import variants
from pcsr.report.tables.scores import scaled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def curve_figures(runs: RunSet) -> "dict[str, Figure]":
    """The charts `training` and `over-touches`, each only if the runs have the numbers for it."""
    drawn = {}
    if (figure := _training(runs)) is not None:
        drawn["training"] = figure
    if (figure := _over_touches(runs)) is not None:
        drawn["over-touches"] = figure
    return drawn


def _training(runs: RunSet) -> "Figure | None":
    """Validated Chamfer distance over the steps, a line for each run; None where no run has validated."""
    validated = {
        name: {line["step"]: 1000 * line["validation"]["cd"] for line in history if "cd" in line.get("validation", {})}
        for name, history in zip(runs.networks, runs.histories, strict=True)
        if history is not None
    }
    validated = {name: values for name, values in validated.items() if values}
    if not validated:
        return None
    steps = sorted({step for values in validated.values() for step in values})
    lines: dict[str, Line] = {
        name: ([values.get(step, math.nan) for step in steps], None) for name, values in validated.items()
    }
    colour_of = _colours(runs)
    colours = [colour_of[id(run)] for name, run in zip(runs.networks, runs.results, strict=True) if name in lines]
    return draw_lines("Validation", "training step", scaled("cd", 1000.0), steps, lines, colours, logarithmic=True)


def _colours(runs: RunSet) -> dict[int, str]:
    """Colour of each run by its identity; the seeds of a recipe have the same one."""
    rows = variants(runs.results, "")
    return {id(run): colour for row, colour in zip(rows, row_colours(rows), strict=True) for run in row.runs}


def _over_touches(runs: RunSet) -> "Figure | None":
    """First metric over the number of touches; None where the runs' names do not vary it."""
    first = runs.results[0]
    metric, note = next(iter(first.metrics.items()))
    axis, rows = varied([row for row in variants(runs.results, "") if metric in row.values])
    numbers = sorted({number for of_label in rows.values() for number in of_label})
    if axis != "touches" or len(numbers) < 2:
        return None
    over_seeds = len({run.seed for run in runs.results}) > 1
    lines: dict[str, Line] = {}
    colour_of = _colours(runs)
    colours = [colour_of[id(next(iter(of_label.values())).runs[0])] for of_label in rows.values()]
    for name, of_label in rows.items():
        measured = [of_label.get(number) for number in numbers]
        means = [math.nan if row is None else row.mean(metric) for row in measured]
        spreads = [0.0 if row is None else row.spread(metric, over_seeds=over_seeds) or 0.0 for row in measured]
        lines[VARIED.sub("", "-" + first.name).strip("-") if name == axis else name] = (means, spreads)
    label = scaled(metric, note.scale)
    spread = f"mean ± sample standard deviation over {'seeds' if over_seeds else 'objects'}"
    return draw_lines(f"{label} over touches, {spread}", "number of touches", label, numbers, lines, colours)
