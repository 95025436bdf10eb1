"""The metrics table for the screen: the page's numbers."""

from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from pcsr.report.results import parse_results
from pcsr.report.scores import scaled, scores


def table(results: dict[str, Any]) -> Table:
    """A row a method: mean ± standard deviation over the objects, the best of a column in bold.

    Args:
        results: what `results.json` holds.

    Raises:
        UserError: a key is missing or of the wrong kind.
    """
    checked = parse_results(results)
    count = len(checked.objects)
    caption = f"mean ± standard deviation over {count} objects of {checked.data.shapes}; lower is better"
    if checked.baseline is not None:
        caption += f"; wins: objects on which the method is better than {checked.baseline}"
    shown = Table(title=escape(checked.name), caption=escape(caption), box=box.SIMPLE_HEAD)
    shown.add_column("method")
    for metric, note in checked.metrics.items():
        shown.add_column(scaled(metric, note.scale), justify="right")
    shown.add_column("parameters", justify="right")
    shown.add_column("s/cloud", justify="right")
    for method, row in zip(checked.methods, scores(checked), strict=True):
        cells = []
        for score in row.values():
            cell = f"[bold]{score}[/bold]" if score.best else str(score)
            cells.append(cell if score.wins is None else f"{cell}\n{score.wins}/{count} wins")
        shown.add_row(escape(method.name), *cells, f"{method.parameters:,}", f"{method.seconds:.3g}")
    return shown
