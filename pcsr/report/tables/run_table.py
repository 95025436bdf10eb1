"""Table of one run's metrics for the terminal, with the numbers of the page."""

from pcsr.counted import counted
from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY, EXCHANGED, EXCHANGED_DEFINITION
from pcsr.report.tables.scores import efficiency_cell, scaled, scores
from pcsr.report.tables.significance import RULE
from pcsr.report.tables.text_table import TextTable
from pcsr.results import Results

SHORT = 2000
"""Number of training steps below which a network may lose to interpolation for lack of training."""


def table(results: Results) -> TextTable:
    """Table with a row for each method: mean ± standard deviation over the objects, a clear best in bold."""
    count = len(results.objects)
    heads = ["method", *(scaled(metric, note.scale) for metric, note in results.metrics.items())]
    heads += [*([EFFICIENCY] if results.touch is not None else []), "parameters", "s/cloud"]
    cells, bold = [], set()
    for i, (method, row) in enumerate(zip(results.methods, scores(results), strict=True)):
        line = [method.name]
        for score in row.values():
            if score.best:
                bold.add((i, len(line)))
            change = f"\n{score.change:+.1%}" if score.change is not None else ""
            wins = f"\n{score.wins}/{count} wins" if score.wins is not None else ""
            line.append(f"{score}{change}{wins}")
        if (effect := results.touch) is not None:
            line.append(efficiency_cell([effect.efficiency], [effect.exchanged_efficiency]) if i == 0 else "")
        cells.append([*line, f"{method.parameters:,}" if method.parameters else "", f"{method.seconds:.3g}"])
    return TextTable(results.name, heads, cells, _note(results), frozenset(bold))


def summary(results: Results) -> str:
    """Sentence with the scores of the first method of a run: ``tapsr: cd ×10³ 1.43 ± 0.81, hd ×10³ 128 ± 46``."""
    first = scores(results)[0]
    listed = (f"{scaled(metric, results.metrics[metric].scale)} {score}" for metric, score in first.items())
    return f"{results.methods[0].name}: {', '.join(listed)}"


def few_steps(results: Results) -> str | None:
    """Sentence that explains a network which is worse than the baseline by its short training; None otherwise."""
    steps, metric = results.training.steps, next(iter(results.metrics))
    change = scores(results)[0][metric].change
    if change is None or change <= 0 or steps is None or steps >= SHORT:
        return None
    return (
        f"{results.methods[0].name} is worse than {results.baseline} in {metric}: its training had "
        f"{counted(steps, 'step')}, and most networks need thousands; raise train.epochs or the number of objects"
    )


def _note(results: Results) -> str:
    note = _protocol(results)
    if results.baseline is not None:
        note += " In per cent: how far the mean is from the baseline's; "
        note += f"wins: objects on which it is better than {results.baseline}. {RULE}."
    if results.touch is not None:
        note += f" {EFFICIENCY.capitalize()}: {DEFINITION}; higher is better."
        if results.touch.exchanged is not None:
            note += f" {EXCHANGED.capitalize()}: {EXCHANGED_DEFINITION}."
    if results.protocol is not None:
        note += f" {results.methods[0].name}: {results.protocol}."
    note += f" s/cloud: {results.timed}."
    if results.training.other_code is not None:
        note += f" Old weights with new code: {results.training.other_code}."
    return note


def _protocol(results: Results) -> str:
    """Data, protocol, metrics' conventions, spread and seed as text."""
    data = results.data
    size = f" of {data.object_size:g} mm" if data.object_size else ""
    covered = f" on {data.coverage:.1%} of the surface" if data.touches and data.coverage is not None else ""
    conventions = "; ".join(f"{name}: {note.description}" for name, note in results.metrics.items())
    return (
        f"{counted(len(results.objects), 'object')}{size}, {data.split} split of {data.shapes}; {data.points} points "
        f"({data.sampling}) and {data.touches} touches{covered} to {data.truth} points; seed {results.seed}. "
        f"{conventions}. Mean ± standard deviation over objects; lower is better."
    )
