"""Tables of a comparison: a row for each recipe, with its seeds together, beside baselines and published values."""

import re
from collections.abc import Sequence
from dataclasses import replace

from pcsr.counted import counted
from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY, EXCHANGED, EXCHANGED_DEFINITION
from pcsr.report.tables.comparison import Comparison, Difference
from pcsr.report.tables.rows import MARK, Row
from pcsr.report.tables.scores import decimals_of, efficiency_cell, scaled
from pcsr.report.tables.significance import CONFIDENCE, LEVEL, RESAMPLES, RULE, smallest_p
from pcsr.report.tables.text_table import TextTable

VARIED = re.compile(r"-(touches|rate)\.(\d+)")
"""Part of a run's name that gives the setting which the paper's tables have as columns."""
COSTS = ("parameters", "s/cloud", "s/epoch")
"""Heads of the columns that are no errors."""


def tables(compared: Comparison) -> list[TextTable]:
    """Tables of a comparison: all metrics; the differences from the first row; the first metric over touches or rates.

    The second one needs a row to compare, and the third runs in which touches or rates vary.
    """
    optional = (_differences_from_first(compared), _over_setting(compared))
    return [_all_metrics(compared), *(one for one in optional if one is not None)]


def paper_tables(compared: Comparison) -> list[TextTable]:
    """Tables of a comparison for a paper: titles that are captions, and narrow columns.

    Of `COSTS` only those are shown that have published values. Intervals have a line of their own.
    """
    first, *others = tables(compared)
    published = {column for row in compared.rows for column in row.published}
    kept = [k for k, head in enumerate(first.heads) if head not in COSTS or head in published]
    first = replace(
        first,
        title=f"Errors on {counted(len(compared.first.runs[0].objects), 'test object')}; lower is better",
        heads=[first.heads[k] for k in kept],
        cells=[[row[k] for k in kept] for row in first.cells],
        bold=frozenset((i, kept.index(k)) for i, k in first.bold),
    )
    narrow = [
        replace(table, cells=[[label, *(cell.replace(" [", "\n[") for cell in row)] for label, *row in table.cells])
        for table in others
    ]
    return [first, *narrow]


def _all_metrics(compared: Comparison) -> TextTable:
    with_touch = any(run.touch for run in compared.runs)
    heads = ["", *(scaled(metric, note.scale) for metric, note in compared.metrics.items())]
    heads += [*([EFFICIENCY] if with_touch else []), *COSTS]
    digits_of = decimals(compared)
    cells, bold = [], set()
    for number, row in enumerate(compared.rows):
        line = [row.marked]
        for metric, digits in digits_of.items():
            if compared.best[metric] == number:
                bold.add((number, len(line)))
            text = f"{row.mean(metric):.{digits}f}"
            if (spread := row.spread(metric, over_seeds=compared.over_seeds)) is not None:
                text += f" ± {spread:.{digits}f}"
            line.append(text + row.published_line(metric))
        if with_touch:
            line.append("" if row.efficiencies is None else efficiency_cell(row.efficiencies, row.exchanged))
        line.append(f"{row.parameters:,}" if row.parameters else "")
        line.append(f"{row.seconds:.3g}" + row.published_line("s/cloud"))
        line.append(("" if row.epoch is None else f"{row.epoch:.3g}") + row.published_line("s/epoch"))
        cells.append(line)
    return TextTable(compared.name, heads, cells, _note(compared, with_touch=with_touch), frozenset(bold))


def decimals(compared: Comparison) -> dict[str, int]:
    """Decimals of each metric."""
    rivals = [row for row in compared.rows if not row.bound]
    return {metric: decimals_of(min(row.mean(metric) for row in rivals)) for metric in compared.metrics}


def difference_decimals(compared: Comparison) -> dict[str, int]:
    """Decimals of the differences in each metric: one more than the means have."""
    return {metric: digits + 1 for metric, digits in decimals(compared).items()}


def _note(compared: Comparison, *, with_touch: bool) -> str:
    """Data, metrics' conventions, and meaning of spreads and marks."""
    runs, rows, data = compared.runs, compared.rows, compared.runs[0].data
    seeds = sorted({run.seed for run in runs})
    spread = f"the means of {len(seeds)} seeds ({', '.join(map(str, seeds))})" if compared.over_seeds else "the objects"
    sizes = " or ".join(dict.fromkeys(f"{run.data.points} points to {run.data.truth}" for run in runs))
    note = (
        f"{counted(len(runs[0].objects), 'object')}, {data.split} split of {data.shapes}; {sizes}; "
        f"{data.normalisation.removesuffix('.')}. Mean ± sample standard deviation over {spread}; lower is better. "
    )
    if compared.tested > 1:
        note += f"{RULE}. "
    if compared.over_seeds:
        networks = [row for row in rows if row.efficiencies is not None]
        fewer = [f"{row.label} {', '.join(map(str, row.seeds))}" for row in networks if row.seeds != seeds]
        note += f"Fewer seeds: {'; '.join(fewer)}. " if fewer else ""
    if stopped := [text for row in rows if (text := _early_stopping(row))]:
        note += f"Early stopping: {'; '.join(stopped)}. "
    if compared.left_out:
        note += f"Left out: {'; '.join(compared.left_out)}. "
    if any(row.published for row in rows):
        note += "Published: on other data. "
    note += "; ".join(f"{metric}: {one.description}" for metric, one in compared.metrics.items()) + "."
    if with_touch:
        note += f" {EFFICIENCY.capitalize()}: {DEFINITION}; higher is better."
    if any(one is not None for row in rows for one in row.exchanged):
        note += f" {EXCHANGED.capitalize()}: {EXCHANGED_DEFINITION}."
    for protocol in dict.fromkeys(row.protocol for row in rows if row.protocol is not None):
        note += f" {', '.join(row.label for row in rows if row.protocol == protocol)}: {protocol}."
    for row in rows:
        if row.other_code is not None:
            note += f" {MARK} {row.label}: old weights with new code, {row.other_code}."
    return note


def _early_stopping(row: Row) -> str:
    """Steps of the weights that early stopping kept; empty for baselines and other trainings."""
    if row.efficiencies is None:
        return ""
    trainings = [run.training for run in row.runs if run.training.best_step is not None]
    kept = dict.fromkeys(f"{training.best_step} of {training.steps}" for training in trainings)
    return f"{row.label} weights of step {', '.join(kept)}" if kept else ""


def _differences_from_first(compared: Comparison) -> TextTable | None:
    """Paired differences with intervals, p-values and wins; None without a row of the same clouds."""
    first, digits_of = compared.first, difference_decimals(compared)
    cells = [
        [
            row.marked,
            *(difference_text(each[number], row, digits_of[metric]) for metric, each in compared.differences.items()),
        ]
        for number, row in enumerate(compared.rows)
        if any(each[number] is not None for each in compared.differences.values())
    ]
    if not cells:
        return None
    objects = len(first.runs[0].objects)
    heads = ["", *(scaled(metric, note.scale) for metric, note in compared.metrics.items())]
    note = (
        f"Mean difference from {first.label}, paired over {counted(objects, 'object')} in the mean over seeds; "
        f"negative is better. In brackets: its {CONFIDENCE:.0%} interval, by {RESAMPLES:,} bootstrap samples of the "
        f"objects; it does not cover the variation between seeds. p: Wilcoxon signed-rank test, after Holm's "
        f"correction for all pairs of {compared.tested} rows. Wins: objects on which the row is better"
    )
    if any(one is not None and one.better_seeds is not None for each in compared.differences.values() for one in each):
        note += "; seeds: those with which its mean is lower"
    if smallest_p(objects, compared.tested) >= LEVEL:
        verb = "is" if objects == 1 else "are"
        note += f". {counted(objects, 'object')} {verb} too few for any significant difference "
        note += f"between {compared.tested} rows"
    return TextTable(f"Differences from {first.label}", heads, cells, f"{note}.")


def difference_text(difference: Difference | None, row: Row, digits: int) -> str:
    """Difference as text, such as ``-0.12 [-0.20, -0.03]``, and lines of the p-value and of wins and seeds."""
    if difference is None:
        return ""
    text = f"{difference.mean:+z.{digits}f}"
    if difference.interval is not None:
        low, high = difference.interval
        text += f" [{low:+z.{digits}f}, {high:+z.{digits}f}]"
    lines = [text] if difference.p_value is None else [text, p_text(difference.p_value)]
    lines.append(f"{difference.wins}/{len(row.runs[0].objects)} wins")
    if difference.better_seeds is not None:
        lines[-1] += f", {difference.better_seeds}/{len(row.runs)} seeds"
    return "\n".join(lines)


def p_text(p_value: float) -> str:
    """A p-value as text: ``p = 0.012``."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.2g}" if p_value < 0.1 else f"p = {p_value:.2f}"


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


def _over_setting(compared: Comparison) -> TextTable | None:
    """The first metric, with the number of touches or the rate as columns; None where neither varies."""
    metric, note = next(iter(compared.metrics.items()))
    axis, by_label = varied(compared.rows)
    columns = sorted({number for of_label in by_label.values() for number in of_label})
    if len(columns) < 2:
        return None
    digits = decimals(compared)[metric]

    def cell(row: Row | None) -> str:
        return "" if row is None else f"{row.mean(metric):.{digits}f}" + row.published_line(metric)

    cells = [[label, *(cell(of_label.get(number)) for number in columns)] for label, of_label in by_label.items()]
    heads = [axis, *map(str, columns)]
    return TextTable(f"{scaled(metric, note.scale)} over {axis}", heads, cells, "Means over objects and seeds.")
