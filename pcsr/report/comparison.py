"""Several runs in one table: each variant a row, its seeds together, beside the baselines and what was published."""

import html
import json
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from PIL.Image import Image
from rich import box
from rich.markup import escape
from rich.table import Table

from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY
from pcsr.report.lettering import png
from pcsr.report.page import shell, table
from pcsr.report.results import Results, parse_results
from pcsr.report.rows import MARK, Row, baselines, variants
from pcsr.report.scores import decimals_of, efficiency_cell, scaled

VARIED = re.compile(r"-(touches|rate)\.(\d+)")
"""What the paper's tables have as columns."""
UNTOLD = ("name", "evaluate.published")
"""Settings that say nothing of how a run was made."""


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
        widest = max(len(line[0]) for line in self.cells)
        shown.add_column(self.heads[0], min_width=widest)  # names that are cut or folded cannot be told apart
        for head in self.heads[1:]:
            shown.add_column(head, justify="right", overflow="fold")
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
    return _tables([parse_results(run) for run in runs], name)


def page(runs: Sequence[dict[str, Any]], name: str, drawn: Mapping[str, Image] | str = "") -> str:
    """The tables as one page that needs nothing but a browser.

    Args:
        runs: what each run's `results.json` holds.
        name: the study's.
        drawn: figures by name, or why there are none.
    """
    checked = [parse_results(run) for run in runs]
    tables = [*_tables(checked, name), *_differences(checked)]
    body = f"<h1>{html.escape(name)}</h1>" + "".join(one.as_html() for one in tables)
    body += _figures(drawn) + _reports(checked)
    return shell(name, body)


def _tables(runs: Sequence[Results], name: str) -> list[Comparison]:
    rows = [*variants(runs, name), *baselines(runs)]
    pivot = _pivot(rows, runs)
    return [_whole(rows, runs, name), *([] if pivot is None else [pivot])]


def _whole(rows: Sequence[Row], runs: Sequence[Results], name: str) -> Comparison:
    notes = runs[0].metrics
    heads = ["", *(scaled(metric, note.scale) for metric, note in notes.items())]
    with_touch = any(run.touch for run in runs)
    heads += [*([EFFICIENCY] if with_touch else []), "parameters", "s/cloud", "s/epoch"]
    seeds = sorted({run.seed for run in runs})
    decimals = {metric: decimals_of(min(row.mean(metric) for row in rows if not row.bound)) for metric in notes}
    cells = []
    for row in rows:
        line = [row.marked]
        for metric, places in decimals.items():
            text = f"{row.mean(metric):.{places}f}"
            if (spread := row.spread(metric, over_seeds=len(seeds) > 1)) is not None:
                text += f" ± {spread:.{places}f}"
            if row is not rows[0] and (wins := row.wins(rows[0], metric)) is not None:
                text += f"\n{wins}/{row.values[metric].shape[1]} wins"
            line.append(text + row.said(metric))
        if with_touch:
            line.append("" if row.efficiencies is None else efficiency_cell(row.efficiencies))
        epoch = "" if row.epoch is None else f"{row.epoch:.3g}"
        line += [f"{row.parameters:,}" if row.parameters else "", f"{row.seconds:.3g}" + row.said("s/cloud")]
        cells.append([*line, epoch + row.said("s/epoch")])
    of = f"the means of {len(seeds)} seeds ({', '.join(map(str, seeds))})" if len(seeds) > 1 else "the objects"
    data = runs[0].data
    sizes = " or ".join(dict.fromkeys(f"{run.data.points} points to {run.data.truth}" for run in runs))
    note = (
        f"{len(runs[0].objects)} objects, {data.split} split of {data.shapes}; {sizes}; "
        f"{data.normalisation.removesuffix('.')}. Mean ± sample standard deviation over {of}; lower is better. "
        f"Wins: objects of the same clouds on which it is better than {rows[0].label}, in the mean over seeds. "
    )
    if any(row.published for row in rows):
        note += "Published: on other data. "
    note += "; ".join(f"{metric}: {of_metric.description}" for metric, of_metric in notes.items()) + "."
    if with_touch:
        note += f" {EFFICIENCY.capitalize()}: {DEFINITION}; higher is better."
    for row in rows:
        if row.other_code is not None:
            note += f" {MARK} {row.label}: old weights with new code, {row.other_code}."
    return Comparison(name, heads, cells, note)


def _differences(runs: Sequence[Results]) -> list[Comparison]:
    """Every setting that is not the same in all runs; nothing where there is none."""
    settings = [_flat(run.recipe) for run in runs]
    keys = dict.fromkeys(key for of_run in settings for key in of_run if not key.startswith(UNTOLD))
    different = [key for key in keys if len({json.dumps(of_run.get(key)) for of_run in settings}) > 1]
    if not different:
        return []
    cells = [[key, *("" if of_run.get(key) is None else str(of_run[key]) for of_run in settings)] for key in different]
    return [Comparison("What differs", ["", *(run.name for run in runs)], cells, "All other settings are the same.")]


def _flat(node: Any, prefix: str = "") -> dict[str, Any]:
    """Nested settings as dotted keys."""
    if not (isinstance(node, dict) and node):
        return {prefix: node}
    flat: dict[str, Any] = {}
    for key, value in node.items():
        flat |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return flat


def _figures(drawn: Mapping[str, Image] | str) -> str:
    """Pictures inside of the page, in fewer colours than their files have, as the page would be large otherwise."""
    if not drawn:
        return ""
    if isinstance(drawn, str):
        return f'<section><h2>Figures</h2><p class="note">None: {html.escape(drawn)}</p></section>'
    shown = "".join(
        f'<p><img alt="{html.escape(name)}" style="max-width: 100%" src="data:image/png;base64,{encoded}"></p>'
        for name, encoded in ((name, b64encode(png(image, colours=128)).decode()) for name, image in drawn.items())
    )
    return f"<section><h2>Figures</h2>{shown}</section>"


def folder_of(run: Results) -> str:
    """The name of its run folder."""
    return f"{run.name}-{run.fingerprint[:8]}"


def _reports(runs: Sequence[Results]) -> str:
    """Links to the reports of the runs, whose folders are beside the page, and where they were made."""
    links = "".join(
        f'<li><a href="{html.escape(folder_of(run))}/report.html">{html.escape(run.name)}</a>, '
        f"pcsr {html.escape(run.version)}, {html.escape(run.created)}, "
        f"{html.escape(run.machine)}</li>"
        for run in runs
    )
    return f"<section><h2>Reports</h2><ul>{links}</ul></section>"


def varied(rows: Sequence[Row]) -> tuple[str, dict[str, dict[int, Row]]]:
    """What the paper's tables have as columns, as it is called; and for each label its rows by that number."""
    places: dict[str, dict[int, Row]] = {}
    axis = ""
    for row in rows:
        if found := VARIED.search("-" + row.label):
            axis = found[1]
            label = VARIED.sub("", "-" + row.label, count=1).strip("-") or axis
            places.setdefault(label, {})[int(found[2])] = row
    return axis, places


def _pivot(rows: Sequence[Row], runs: Sequence[Results]) -> Comparison | None:
    """The first metric, with the number of touches or the rate as columns; None where neither varies."""
    metric, note = next(iter(runs[0].metrics.items()))
    axis, places = varied(rows)
    columns = sorted({number for of_label in places.values() for number in of_label})
    if len(columns) < 2:
        return None
    digits = decimals_of(min(row.mean(metric) for row in rows if not row.bound))

    def cell(row: Row | None) -> str:
        if row is None:
            return ""
        return f"{row.mean(metric):.{digits}f}" + row.said(metric)

    cells = [[label, *(cell(of_label.get(number)) for number in columns)] for label, of_label in places.items()]
    heads = [axis, *map(str, columns)]
    return Comparison(f"{scaled(metric, note.scale)} over {axis}", heads, cells, "Means over objects and seeds.")
