"""Tables of several runs: a row for each recipe, with its seeds together, beside baselines and published values."""

import json
import re
from collections.abc import Sequence
from typing import Any

from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY
from pcsr.report.tables.rows import MARK, Row, baselines, variants
from pcsr.report.tables.scores import decimals_of, efficiency_cell, scaled
from pcsr.report.tables.text_table import TextTable
from pcsr.results import Results

VARIED = re.compile(r"-(touches|rate)\.(\d+)")
"""Part of a run's name that gives the setting which the paper's tables have as columns."""
LEFT_OUT = ("name", "evaluate.published")
"""Settings that do not affect a run."""


def compare(runs: Sequence[Results], name: str) -> list[TextTable]:
    """Tables of a study: one of all metrics; and one of the first metric over touches or rates, where those vary.

    Args:
        runs: at least one.
        name: name of the study.
    """
    rows = [*variants(runs, name), *baselines(runs)]
    over = _over_setting(rows, runs)
    return [_all_metrics(rows, runs, name), *([] if over is None else [over])]


def _all_metrics(rows: Sequence[Row], runs: Sequence[Results], name: str) -> TextTable:
    notes = runs[0].metrics
    heads = ["", *(scaled(metric, note.scale) for metric, note in notes.items())]
    with_touch = any(run.touch for run in runs)
    heads += [*([EFFICIENCY] if with_touch else []), "parameters", "s/cloud", "s/epoch"]
    over_seeds = len({run.seed for run in runs}) > 1
    decimals = {metric: decimals_of(min(row.mean(metric) for row in rows if not row.bound)) for metric in notes}
    cells = []
    for row in rows:
        line = [row.marked]
        for metric, digits in decimals.items():
            text = f"{row.mean(metric):.{digits}f}"
            if (spread := row.spread(metric, over_seeds=over_seeds)) is not None:
                text += f" ± {spread:.{digits}f}"
            if row is not rows[0] and (wins := row.wins(rows[0], metric)) is not None:
                text += f"\n{wins}/{row.values[metric].shape[1]} wins"
            line.append(text + row.published_line(metric))
        if with_touch:
            line.append("" if row.efficiencies is None else efficiency_cell(row.efficiencies))
        line.append(f"{row.parameters:,}" if row.parameters else "")
        line.append(f"{row.seconds:.3g}" + row.published_line("s/cloud"))
        line.append(("" if row.epoch is None else f"{row.epoch:.3g}") + row.published_line("s/epoch"))
        cells.append(line)
    return TextTable(name, heads, cells, _note(rows, runs, with_touch=with_touch))


def _note(rows: Sequence[Row], runs: Sequence[Results], *, with_touch: bool) -> str:
    """Data, metrics' conventions, and meaning of spreads and marks."""
    seeds = sorted({run.seed for run in runs})
    spread = f"the means of {len(seeds)} seeds ({', '.join(map(str, seeds))})" if len(seeds) > 1 else "the objects"
    data = runs[0].data
    sizes = " or ".join(dict.fromkeys(f"{run.data.points} points to {run.data.truth}" for run in runs))
    note = (
        f"{len(runs[0].objects)} objects, {data.split} split of {data.shapes}; {sizes}; "
        f"{data.normalisation.removesuffix('.')}. Mean ± sample standard deviation over {spread}; lower is better. "
        f"Wins: objects of the same clouds on which it is better than {rows[0].label}, in the mean over seeds. "
    )
    if any(row.published for row in rows):
        note += "Published: on other data. "
    note += "; ".join(f"{metric}: {one.description}" for metric, one in runs[0].metrics.items()) + "."
    if with_touch:
        note += f" {EFFICIENCY.capitalize()}: {DEFINITION}; higher is better."
    for protocol in dict.fromkeys(row.protocol for row in rows if row.protocol is not None):
        note += f" {', '.join(row.label for row in rows if row.protocol == protocol)}: {protocol}."
    for row in rows:
        if row.other_code is not None:
            note += f" {MARK} {row.label}: old weights with new code, {row.other_code}."
    return note


def differences(runs: Sequence[Results]) -> TextTable | None:
    """Table of the settings in which the runs differ; None if they differ in none."""
    settings = [_flat(run.recipe) for run in runs]
    keys = dict.fromkeys(key for of_run in settings for key in of_run if not key.startswith(LEFT_OUT))
    different = [key for key in keys if len({json.dumps(of_run.get(key)) for of_run in settings}) > 1]
    if not different:
        return None
    cells = [[key, *("" if of_run.get(key) is None else str(of_run[key]) for of_run in settings)] for key in different]
    return TextTable("What differs", ["", *(run.name for run in runs)], cells, "All other settings are the same.")


def _flat(node: Any, prefix: str = "") -> dict[str, Any]:
    """Nested settings as dotted keys."""
    if not (isinstance(node, dict) and node):
        return {prefix: node}
    flat: dict[str, Any] = {}
    for key, value in node.items():
        flat |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return flat


def varied(rows: Sequence[Row]) -> tuple[str, dict[str, dict[int, Row]]]:
    """The setting that the runs' names vary, and for each label its rows by the value of that setting."""
    by_label: dict[str, dict[int, Row]] = {}
    axis = ""
    for row in rows:
        if found := VARIED.search("-" + row.label):
            axis = found[1]
            label = VARIED.sub("", "-" + row.label, count=1).strip("-") or axis
            by_label.setdefault(label, {})[int(found[2])] = row
    return axis, by_label


def _over_setting(rows: Sequence[Row], runs: Sequence[Results]) -> TextTable | None:
    """The first metric, with the number of touches or the rate as columns; None where neither varies."""
    metric, note = next(iter(runs[0].metrics.items()))
    axis, by_label = varied(rows)
    columns = sorted({number for of_label in by_label.values() for number in of_label})
    if len(columns) < 2:
        return None
    digits = decimals_of(min(row.mean(metric) for row in rows if not row.bound))

    def cell(row: Row | None) -> str:
        return "" if row is None else f"{row.mean(metric):.{digits}f}" + row.published_line(metric)

    cells = [[label, *(cell(of_label.get(number)) for number in columns)] for label, of_label in by_label.items()]
    heads = [axis, *map(str, columns)]
    return TextTable(f"{scaled(metric, note.scale)} over {axis}", heads, cells, "Means over objects and seeds.")
