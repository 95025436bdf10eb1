"""Several runs in one table: each variant a row, its seeds together, beside the baselines and what was published."""

import html
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from pcsr.report.page import shell, table
from pcsr.report.results import MethodResult, Results, parse_results
from pcsr.report.scores import decimals_of, scaled

VARIED = re.compile(r"-(touches|rate)\.(\d+)")
"""What the paper's tables have as columns."""
SEED = re.compile(r"-seed\.\d+")


@dataclass(frozen=True)
class Row:
    """A variant, or a baseline."""

    label: str
    values: dict[str, np.ndarray]
    """Of each metric, times its scale: a line for each seed, a column for each object."""
    published: dict[str, float]
    parameters: int
    seconds: float
    """For one cloud."""
    epoch: float | None
    """Seconds of training for each epoch, the mean over seeds; None for a baseline and for weights that don't say."""

    def mean(self, metric: str) -> float:
        """Over objects and seeds."""
        return float(self.values[metric].mean())

    def spread(self, metric: str) -> float:
        """Sample standard deviation of the seeds' means; with one seed, of the objects."""
        values = self.values[metric]
        each = values.mean(1) if len(values) > 1 else values[0]
        return float(each.std(ddof=1)) if len(each) > 1 else 0.0

    def said(self, column: str) -> str:
        """What was published of it, in a line of its own."""
        return f"\npublished {self.published[column]:g}" if column in self.published else ""

    def wins(self, other: "Row", metric: str) -> int | None:
        """Objects on which it is strictly better, in the mean over seeds; None if those were other objects."""
        own, theirs = self.values[metric].mean(0), other.values[metric].mean(0)
        return int((own < theirs).sum()) if own.shape == theirs.shape else None


@dataclass(frozen=True)
class Comparison:
    """A table as plain text, for the screen and for a page."""

    title: str
    heads: list[str]
    cells: list[list[str]]
    note: str

    def on_screen(self) -> Table:
        """For a terminal."""
        shown = Table(title=escape(self.title), caption=escape(self.note), box=box.SIMPLE_HEAD)
        for number, head in enumerate(self.heads):
            shown.add_column(head, justify="right" if number else "left")
        for line in self.cells:
            shown.add_row(*map(escape, line))
        return shown

    def as_html(self) -> str:
        """A section of a page."""
        lines = [[html.escape(cell).replace("\n", "<br>") for cell in line] for line in self.cells]
        shown = table([html.escape(head) for head in self.heads], lines)
        note = f'<p class="note">{html.escape(self.note)}</p>'
        return f"<section><h2>{html.escape(self.title)}</h2>{shown}{note}</section>"


def compare(runs: Sequence[dict[str, Any]], name: str) -> list[Comparison]:
    """The tables of a study: all that was measured; and the first metric over touches or rates, where those vary.

    Args:
        runs: what each run's `results.json` holds.
        name: the study's.

    Raises:
        UserError: results that are malformed.
    """
    checked = [parse_results(run) for run in runs]
    rows = [*variants(checked, name), *_baselines(checked)]
    tables = [_whole(rows, checked, name)]
    if (pivot := _pivot(rows, checked)) is not None:
        tables.append(pivot)
    return tables


def page(runs: Sequence[dict[str, Any]], name: str, *, plotly: str) -> str:
    """The tables as one page that needs nothing but a browser."""
    body = f"<h1>{html.escape(name)}</h1>" + "".join(one.as_html() for one in compare(runs, name))
    return shell(name, body, {"examples": [], "charts": {}}, plotly=plotly)


def variants(runs: Sequence[Results], name: str) -> list[Row]:
    """A row for each recipe; runs that differ in nothing but their seed share one."""
    together: dict[str, list[Results]] = {}
    for run in runs:
        same = {key: value for key, value in run.recipe.items() if key not in ("name", "seed")}
        together.setdefault(json.dumps(same, sort_keys=True), []).append(run)
    rows = []
    for of_one in together.values():
        label = SEED.sub("", of_one[0].name).removeprefix(f"{name}-")
        published = of_one[0].recipe.get("evaluate", {}).get("published", {})
        rows.append(_row(label, [run.methods[0] for run in of_one], of_one, published))
    return rows


def _baselines(runs: Sequence[Results]) -> list[Row]:
    """Each baseline once, unless it was measured on other clouds."""
    rows: list[Row] = []
    for run in runs:
        for method in run.methods[1:]:
            row = _row(method.name, [method], [run], {})
            if not any(
                row.label == old.label and all(np.array_equal(row.values[m], old.values[m]) for m in row.values)
                for old in rows
            ):
                rows.append(row)
    return rows


def _row(label: str, methods: Sequence[MethodResult], runs: Sequence[Results], published: dict[str, float]) -> Row:
    values = {
        metric: np.array([method.values[metric] for method in methods]) * note.scale
        for metric, note in runs[0].metrics.items()
    }
    trained = [run.training.seconds for run in runs if run.training.seconds is not None]
    of_network = methods[0] is runs[0].methods[0] and trained
    return Row(
        label,
        values,
        published,
        methods[0].parameters,
        float(np.mean([method.seconds for method in methods])),
        float(np.mean(trained)) / runs[0].recipe["train"]["epochs"] if of_network else None,
    )


def _whole(rows: Sequence[Row], runs: Sequence[Results], name: str) -> Comparison:
    notes = runs[0].metrics
    heads = ["", *(scaled(metric, note.scale) for metric, note in notes.items())]
    heads += ["parameters", "s/cloud", "s/epoch"]
    cells = []
    for row in rows:
        line = [row.label]
        for metric in notes:
            places = decimals_of(min(other.mean(metric) for other in rows))
            text = f"{row.mean(metric):.{places}f} ± {row.spread(metric):.{places}f}"
            if row is not rows[0] and (wins := row.wins(rows[0], metric)) is not None:
                text += f"\n{wins}/{row.values[metric].shape[1]} wins"
            line.append(text + row.said(metric))
        epoch = "" if row.epoch is None else f"{row.epoch:.3g}"
        line += [f"{row.parameters:,}" if row.parameters else "", f"{row.seconds:.3g}" + row.said("s/cloud")]
        cells.append([*line, epoch + row.said("s/epoch")])
    seeds = sorted({run.seed for run in runs})
    of = f"the means of {len(seeds)} seeds ({', '.join(map(str, seeds))})" if len(seeds) > 1 else "the objects"
    data = runs[0].data
    note = (
        f"{len(runs[0].objects)} objects, {data.split} split of {data.shapes}; {data.points} points to {data.truth}. "
        f"Mean ± sample standard deviation over {of}; lower is better. Wins: objects on which it is better than "
        f"{rows[0].label}. Published: on other data. "
        + "; ".join(f"{metric}: {of_metric.description}" for metric, of_metric in notes.items())
        + "."
    )
    return Comparison(name, heads, cells, note)


def _pivot(rows: Sequence[Row], runs: Sequence[Results]) -> Comparison | None:
    """The first metric, with the number of touches or the rate as columns; None where neither varies."""
    metric, note = next(iter(runs[0].metrics.items()))
    places: dict[str, dict[int, Row]] = {}
    axis = ""
    for row in rows:
        if found := VARIED.search("-" + row.label):
            axis = found[1]
            label = VARIED.sub("", "-" + row.label, count=1).strip("-") or axis
            places.setdefault(label, {})[int(found[2])] = row
    columns = sorted({number for of_label in places.values() for number in of_label})
    if len(columns) < 2:
        return None
    digits = decimals_of(min(row.mean(metric) for row in rows))

    def cell(row: Row | None) -> str:
        if row is None:
            return ""
        return f"{row.mean(metric):.{digits}f}" + row.said(metric)

    cells = [[label, *(cell(of_label.get(number)) for number in columns)] for label, of_label in places.items()]
    heads = [axis, *map(str, columns)]
    return Comparison(f"{scaled(metric, note.scale)} over {axis}", heads, cells, "Means over objects and seeds.")
