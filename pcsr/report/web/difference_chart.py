"""Chart of the differences from the first row of a comparison, with their intervals, in HTML that fits any width."""

import html
from collections.abc import Sequence

from pcsr.report.tables.comparison import Comparison, Difference
from pcsr.report.tables.comparison_tables import difference_decimals, difference_text
from pcsr.report.tables.scores import scaled

MARGIN = 0.04
"""Space on both sides of the outermost ends, as a fraction of the width."""
APART = 0.2
"""Least distance of an end's number from that of 0, as a fraction of the width."""


def difference_chart(compared: Comparison, colours: Sequence[str]) -> str:
    """HTML section with a panel for each metric; empty without a row to compare.

    Args:
        compared: the numbers.
        colours: colour of each row.
    """
    panels = "".join(_panel(compared, metric, colours) for metric in compared.metrics)
    if not panels:
        return ""
    first = html.escape(compared.first.label)
    note = f"Left of the line is better than {first}; bars are 95 % intervals. "
    if 'class="beyond"' in panels:
        note += "The scale is that of the networks: an arrow means that a baseline is beyond it. "
    note += "The numbers are in the table below."
    return (
        f'<section id="chart"><h2>Compared with {first}</h2><div class="pair">{panels}</div>'
        f'<p class="note">{note}</p></section>'
    )


def _panel(compared: Comparison, metric: str, colours: Sequence[str]) -> str:
    """Panel of one metric. The floor is left out, and baselines do not widen the scale of networks."""
    rows = [
        (row, colour, difference)
        for row, colour, difference in zip(compared.rows, colours, compared.differences[metric], strict=True)
        if difference is not None and not row.bound
    ]
    if not rows:
        return ""
    scaling = [one for row, _, one in rows if row.efficiencies is not None] or [one for *_, one in rows]
    ends = [0.0, *(end for one in scaling for end in _ends(one))]
    low, high = min(ends), max(ends)
    width = high - low or 1.0

    def at(value: float) -> str:
        return f"{100 * ((value - low) / width * (1 - 2 * MARGIN) + MARGIN):.2f}%"

    digits = difference_decimals(compared)[metric]
    lines = []
    for row, colour, one in rows:
        left, right = (min(max(end, low), high) for end in _ends(one))
        text = html.escape(difference_text(one, row, digits).replace("\n", ", "))
        marks = ""
        if _ends(one)[0] <= high and _ends(one)[1] >= low:
            marks = (
                f'<i class="bar" style="left: {at(left)}; right: calc(100% - {at(right)}); background: {colour}"></i>'
            )
        if low <= one.mean <= high:
            marks += f'<i class="dot" style="left: {at(one.mean)}; background: {colour}"></i>'
        if _ends(one)[0] < low:
            marks += f'<i class="beyond" style="left: 0; color: {colour}">◀</i>'
        if _ends(one)[1] > high:
            marks += f'<i class="beyond" style="right: 0; color: {colour}">▶</i>'
        label = html.escape(row.marked)
        zero = f'<i class="zero" style="left: {at(0.0)}"></i>'
        lines.append(f'<div class="line" title="{text}"><span>{label}</span><div>{zero}{marks}</div></div>')
    ticks = [0.0, *(end for end in (low, high) if abs(end) > APART * width)]
    at_border = {low: "left: 0; transform: none", high: "right: 0; transform: none", 0.0: f"left: {at(0.0)}"}
    numbers = "".join(f'<i style="{at_border[end]}">{f"{end:+.{digits}f}" if end else "0"}</i>' for end in ticks)
    lines.append(f'<div class="line ticks"><span></span><div>{numbers}</div></div>')
    title = html.escape(scaled(metric, compared.metrics[metric].scale))
    return f'<div class="differences"><h3>{title}</h3>{"".join(lines)}</div>'


def _ends(difference: Difference) -> tuple[float, float]:
    """Ends of the interval; the mean itself where there is none."""
    return difference.interval or (difference.mean, difference.mean)
