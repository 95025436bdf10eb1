"""Report of one run as an interactive HTML page."""

import html
from io import StringIO
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from pcsr.counted import counted
from pcsr.metrics.touch_effect import DEFINITION, EFFICIENCY, EXCHANGED, EXCHANGED_DEFINITION, TouchEffect
from pcsr.report.colours import ERROR_SCALE
from pcsr.report.tables.scores import efficiency_cell, group_means, scaled, scores
from pcsr.report.tables.significance import RULE
from pcsr.report.web.curves import group_chart, touch_chart, training_charts
from pcsr.report.web.document import document, example_tabs, table
from pcsr.report.web.views import views
from pcsr.results import Results
from pcsr.run_files import FinishedRun


def render(run: FinishedRun, *, plotly: str) -> str:
    """HTML page of a run.

    Args:
        run: the run; each of its examples becomes a row of views.
        plotly: source of plotly.js.
    """
    results = run.results
    metric = next(iter(results.metrics))
    charts = {"groups": group_chart(results, metric)} if len(set(results.groups)) > 1 else {}
    if results.touch is not None:
        charts["touch"] = touch_chart(results.touch)
    if run.history is not None:
        charts |= training_charts(run.history)
    body = "\n".join(
        (
            f"<h1>{html.escape(results.name)}</h1>",
            f'<p class="lead">{_statement(results)}</p>',
            _warning(results),
            _metrics(results),
            "" if results.touch is None else _touch(results.touch),
            _examples(run),
            _groups(results, metric) if "groups" in charts else "",
            _training(run, charts),
            _recipe(results),
        )
    )
    drawn = {"examples": [views(example) for example in run.examples], "charts": charts}
    return document(f"{results.name}: results", body, drawn, plotly=plotly)


def _statement(results: Results) -> str:
    """Data, protocol, conventions, seed and spread of the numbers on the page."""
    data, count = results.data, len(results.objects)
    size = f" of {data.object_size:g} mm" if data.object_size is not None else ""
    left_out = f" ({data.left_out} left out as unusable)" if data.left_out else ""
    touches = "no touches"
    if data.touches:
        touches = f"{data.touches} touch{'es' if data.touches > 1 else ''}"
        if data.coverage is not None:
            touches += f" on {100 * data.coverage:.3g} % of the true points"
    protocol = f"{results.methods[0].name} makes them {results.protocol}. " if results.protocol is not None else ""
    text = (
        f"{counted(count, 'object')}{size} of {data.shapes}, split {data.split}{left_out}. "
        f"{data.points} points (sampling: {data.sampling}) and {touches} become {data.truth} points ({data.rate}×). "
        f"{protocol}Clouds are {data.normalisation.removesuffix('.')}. "
        f"Numbers are mean ± sample standard deviation over the objects, of one training with seed {results.seed}; "
        f"lower is better. Recipe {results.fingerprint[:8]}, pcsr {results.version}, {results.created}."
    )
    return html.escape(text)


def _warning(results: Results) -> str:
    """Warning where old weights were measured with new code."""
    if results.training.other_code is None:
        return ""
    text = f"These are old weights with new code: {results.training.other_code}."
    return f'<p class="warning"><strong>{html.escape(text)}</strong></p>'


def _metrics(results: Results) -> str:
    count = len(results.objects)
    heads = [scaled(name, note.scale) for name, note in results.metrics.items()]
    rows = []
    for method, row in zip(results.methods, scores(results), strict=True):
        cells = [html.escape(method.name)]
        for score in row.values():
            mark = f'<strong title="significantly the best">{score}</strong>' if score.best else str(score)
            wins = f"<small>{score.wins}/{count} wins</small>" if score.wins is not None else ""
            change = f"<br>{score.change:+.1%} " if score.change is not None else ""
            cells.append(mark + change + wins)
        if (effect := results.touch) is not None:
            cell = efficiency_cell([effect.efficiency], [effect.exchanged_efficiency])
            cells.append(html.escape(cell).replace("\n", "<br>") if method is results.methods[0] else "")
        rows.append([*cells, f"{method.parameters:,}", f"{method.seconds:.3g}"])
    terms = {name: note.description for name, note in results.metrics.items()}
    if results.touch is not None:
        terms[EFFICIENCY] = f"{DEFINITION}; higher is better"
        if results.touch.exchanged is not None:
            terms[EXCHANGED] = EXCHANGED_DEFINITION
    terms["seconds"] = results.timed
    if results.baseline is not None:
        terms["wins"] = f"objects on which the method is strictly better than {results.baseline}"
        terms["bold"] = RULE.removeprefix("Bold: ")
    meanings = "".join(f"<dt>{html.escape(term)}</dt><dd>{html.escape(text)}</dd>" for term, text in terms.items())
    if results.touch is not None:
        heads.append(EFFICIENCY)
    shown = table(["method", *map(html.escape, heads), "parameters", "seconds per cloud"], rows)
    return f'<section id="metrics"><h2>Metrics</h2>{shown}<dl>{meanings}</dl></section>'


def _touch(touch: TouchEffect) -> str:
    """Section with the numbers that the touch efficiency is computed from, and the error by distance."""
    means = {
        "with touches": touch.touched,
        "without": touch.plain,
        "without, but with the touched region replaced by the truth": touch.replaced,
    }
    if touch.exchanged is not None:
        means["with the touches of another object"] = touch.exchanged
    listed = "; ".join(f"{name}: {1000 * np.mean(values):.4g}" for name, values in means.items())
    text = (
        f"Mean Chamfer distance ×10³ of the network {listed}. "
        f"A cloud without touches takes {touch.seconds:.3g} seconds. "
        "The chart shows the mean squared distance from a point of the truth to the nearest point of the cloud, by how "
        "far the point of the truth lies from the nearest touched point."
    )
    return (
        f'<section id="touch"><h2>Effect of touch</h2><p class="note">{html.escape(text)}</p>'
        '<div class="chart" data-chart="touch"></div></section>'
    )


def _groups(results: Results, metric: str) -> str:
    """Section with the chart of the first metric by group, and a folded table of all metrics."""
    means = {name: group_means(results, name) for name in results.metrics}
    heads = [
        f"{html.escape(method.name)}<br>{html.escape(scaled(name, note.scale))}"
        for name, note in results.metrics.items()
        for method in results.methods
    ]
    rows = [
        [html.escape(g), str(results.groups.count(g)), *(f"{v:#.4g}" for name in means for v in means[name][g])]
        for g in means[metric]
    ]
    shown = table(["group", "objects", *heads], rows)
    return (
        '<section id="by-group"><h2>By group of objects</h2><div class="chart" data-chart="groups"></div>'
        f"<details><summary>Every metric as a table</summary>{shown}</details></section>"
    )


def _examples(run: FinishedRun) -> str:
    if not run.examples:
        return ""
    tabs = example_tabs([example.name for example in run.examples])
    gradient = ", ".join(f"{colour} {100 * fraction:g}%" for fraction, colour in ERROR_SCALE)
    note = (
        f"Colour is the distance from a predicted point to the nearest of the {run.results.data.truth} true points, "
        "on one scale for the row; its end is the error that one point in a hundred exceeds. The expected error is "
        "predicted without the truth, from the input alone: 68 % of the points lie within it. "
        "Turning one view turns all; double-click to turn back."
    )
    return (
        f'<section id="examples"><h2>Examples</h2><nav>{tabs}</nav><div class="row"></div>'
        f'<div class="scale"><span>0</span><i style="background: linear-gradient(to right, {gradient})"></i>'
        f'<span id="limit"></span></div><p class="note">{html.escape(note)}</p></section>'
    )


def _training(run: FinishedRun, charts: dict[str, Any]) -> str:
    """Section with the training curves, or with the origin of the weights if the run did not train."""
    training = run.results.training
    facts = [
        *run.results.budget,
        *([_duration(training.seconds)] if training.seconds is not None else []),
        *([f"on {training.device}"] if training.device is not None else []),
        *([f"threads: {training.threads}"] if training.threads is not None else []),
    ]
    text = f"Weights: {training.source}. Training: {', '.join(facts) or 'nothing is known of it'}."
    if run.history is None:
        text = f"The weights came ready-trained, so there is no curve. {text}"
    drawn = "".join(
        f'<div class="chart" data-chart="{name}"></div>' for name in ("loss", "validation") if name in charts
    )
    return (
        f'<section id="training"><h2>Training</h2><p>{html.escape(text)}</p><div class="pair">{drawn}</div></section>'
    )


def _duration(seconds: int | float) -> str:
    return f"{seconds:.1f} seconds" if seconds < 100 else f"{seconds / 60:.1f} minutes"


def _recipe(results: Results) -> str:
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    text = StringIO()
    yaml.dump(results.recipe, text)
    return (
        '<section id="recipe"><h2>Recipe</h2><details><summary>Every setting, defaults included</summary>'
        f"<pre>{html.escape(text.getvalue())}</pre></details></section>"
    )
