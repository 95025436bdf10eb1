"""The metrics table for the screen: the page's numbers."""

from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY
from pcsr.report.results import Results, parse_results
from pcsr.report.scores import efficiency_cell, scaled, scores


def table(results: dict[str, Any]) -> Table:
    """A row a method: mean ± standard deviation over the objects, the best of a column in bold.

    Args:
        results: what `results.json` holds.

    Raises:
        UserError: a key is missing or of the wrong kind.
    """
    checked = parse_results(results)
    count = len(checked.objects)
    caption = protocol(checked)
    if checked.baseline is not None:
        caption += " In per cent: how far the mean is from the baseline's; "
        caption += f"wins: objects on which it is better than {checked.baseline}."
    if checked.touch is not None:
        caption += f" {EFFICIENCY.capitalize()}: {DEFINITION}; higher is better."
    caption += f" s/cloud: {checked.timed}."
    if checked.training.other_code is not None:
        caption += f" Old weights with new code: {checked.training.other_code}."
    shown = Table(title=escape(checked.name), caption=escape(caption), box=box.SIMPLE_HEAD)
    shown.add_column("method")
    for metric, note in checked.metrics.items():
        shown.add_column(scaled(metric, note.scale), justify="right")
    if checked.touch is not None:
        shown.add_column(EFFICIENCY, justify="right", min_width=len("efficiency"))
    shown.add_column("parameters", justify="right")
    shown.add_column("s/cloud", justify="right")
    for method, row in zip(checked.methods, scores(checked), strict=True):
        cells = []
        for score in row.values():
            cell = f"[bold]{score}[/bold]" if score.best else str(score)
            change = f"\n{score.change:+.1%}" if score.change is not None else ""
            cells.append(cell if score.wins is None else f"{cell}{change}\n{score.wins}/{count} wins")
        if checked.touch is not None:
            cells.append(efficiency_cell([checked.touch.efficiency]) if method is checked.methods[0] else "")
        shown.add_row(escape(method.name), *cells, f"{method.parameters:,}", f"{method.seconds:.3g}")
    return shown


def protocol(results: Results) -> str:
    """Data, protocol, metrics' conventions, spread and seed in words."""
    data = results.data
    size = f" of {data.object_size:g} mm" if data.object_size else ""
    covered = f" on {data.coverage:.1%} of the surface" if data.touches and data.coverage is not None else ""
    conventions = "; ".join(f"{name}: {note.description}" for name, note in results.metrics.items())
    return (
        f"{len(results.objects)} objects{size}, {data.split} split of {data.shapes}; {data.points} points "
        f"({data.sampling}) and {data.touches} touches{covered} to {data.truth} points; seed {results.seed}. "
        f"{conventions}. Mean ± standard deviation over objects; lower is better."
    )
