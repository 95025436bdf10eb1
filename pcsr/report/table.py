"""The results as a table: on the screen, and the same numbers for the page."""

from statistics import fmean, stdev
from typing import Any, NamedTuple

from rich.table import Table


class Cell(NamedTuple):
    """One metric of one method, scaled as its column's head says."""

    mean: float
    spread: float
    """Standard deviation over objects; 0 for a single one."""
    wins: int
    """Objects in which the method beats the first baseline."""
    best: bool

    def __str__(self) -> str:
        return f"{self.mean:.3f} ± {self.spread:.3f}"


def cells(results: dict[str, Any]) -> dict[tuple[str, str], Cell]:
    """A cell for each method and metric."""
    methods = results["methods"]
    baseline = methods[1]["values"] if len(methods) > 1 else {}
    table = {}
    for metric, about in results["metrics"].items():
        scale = about["scale"]
        means = {m["name"]: scale * fmean(m["values"][metric]) for m in methods}
        for method in methods:
            values = method["values"][metric]
            wins = sum(ours < theirs for ours, theirs in zip(values, baseline.get(metric, values), strict=True))
            spread = scale * stdev(values) if len(values) > 1 else 0.0
            mean = means[method["name"]]
            table[method["name"], metric] = Cell(mean, spread, wins, mean == min(means.values()))
    return table


def statement(results: dict[str, Any]) -> str:
    """Data, protocol, convention, seed and spread in words."""
    data = results["data"]
    metrics = "; ".join(f"{name}: {about['description']}" for name, about in results["metrics"].items())
    size = f", objects of {data['object_size']:g} mm" if data["object_size"] else ""
    covered = f", which cover {100 * data['coverage']:.1f} % of the surface" if data["touches"] else ""
    return (
        f"{len(results['objects'])} objects of the {data['split']} split of {data['shapes']}{size}; "
        f"{data['points']} points drawn {data['sampling']} and {data['touches']} touches{covered}, "
        f"to {data['truth']} points. {data['normalisation'].capitalize()}. {metrics}. Lower is better; "
        f"mean ± standard deviation over objects. Seed {results['seed']}."
    )


def compared(results: dict[str, Any]) -> str:
    """What came out, in a sentence: the method beside the first baseline in the first metric."""
    if len(results["methods"]) < 2:
        return ""
    ours, theirs = results["methods"][:2]
    metric = next(iter(results["metrics"]))
    table = cells(results)
    a, b = table[ours["name"], metric], table[theirs["name"], metric]
    change = 100 * (a.mean / b.mean - 1) if b.mean else 0.0
    word = "below" if change < 0 else "above"
    return (
        f"{metric} of {ours['name']} is {abs(change):.1f} % {word} {theirs['name']}, "
        f"and lower in {a.wins} of {len(results['objects'])} objects."
    )


def table(results: dict[str, Any]) -> Table:
    """The results for the screen."""
    screen = Table(title=results["name"], caption=f"{statement(results)} {compared(results)}", caption_justify="left")
    screen.add_column("method")
    for metric, about in results["metrics"].items():
        screen.add_column(f"{metric} ×{about['scale']}", justify="right")
    for head in ("wins", "weights", "s a cloud"):
        screen.add_column(head, justify="right")
    rows = cells(results)
    first = next(iter(results["metrics"]))
    for number, method in enumerate(results["methods"]):
        shown = [rows[method["name"], metric] for metric in results["metrics"]]
        texts = [f"[bold]{cell}[/bold]" if cell.best else str(cell) for cell in shown]
        wins = f"{rows[method['name'], first].wins}/{len(results['objects'])}" if number != 1 else ""
        screen.add_row(method["name"], *texts, wins, f"{method['parameters']:,}", f"{method['seconds']:.2f}")
    return screen
