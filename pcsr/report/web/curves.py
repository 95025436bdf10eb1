"""Charts of the page as plotly figures: metric by group, error by distance to a touch, training curves."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from pcsr.metrics.touch_effect import TouchEffect
from pcsr.report.colours import SERIES
from pcsr.report.tables.scores import group_means, scaled
from pcsr.results import Results

DOTS = 500
"""Largest number of points along a curve."""


def group_chart(results: Results, metric: str) -> dict[str, Any]:
    """Bar chart of a metric by group of objects; the groups with the largest values of the first method at the top."""
    means = sorted(group_means(results, metric).items(), key=lambda item: -item[1][0])
    traces = [
        {
            "type": "bar",
            "orientation": "h",
            # plotly reads names as markup
            "name": html.escape(method.name, quote=False),
            "y": [html.escape(group, quote=False) for group, _ in means],
            "x": [round(values[k], 4) for _, values in means],
            "marker": {"color": SERIES[k % len(SERIES)]},
            "hovertemplate": "%{y}: %{x}",
        }
        for k, method in enumerate(results.methods)
    ]
    title = f"mean {scaled(metric, results.metrics[metric].scale)}"
    layout = {
        "barmode": "group",
        "bargap": 0.3,
        "height": 110 + (12 * len(results.methods) + 8) * len(means),
        "xaxis": {"title": {"text": title}, "rangemode": "tozero"},
        # Reversed, so that bars have the order of the legend.
        "yaxis": {"type": "category", "autorange": "reversed"},
        "legend": {"traceorder": "normal"},
    }
    return {"data": traces, "layout": layout}


def touch_chart(touch: TouchEffect) -> dict[str, Any]:
    """Line chart of the error by distance to the nearest touched point; bins without points are left out."""
    ends = [*(f"to {end:g}" for end in touch.edges[1:]), "beyond"]
    filled = [k for k, count in enumerate(touch.counts) if count]
    traces = []
    for k, (name, errors) in enumerate(touch.errors.items()):
        values = [errors[i] for i in filled]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": html.escape(name, quote=False),
                "x": [ends[i] for i in filled],
                "y": [None if value is None else float(f"{1000 * value:.6g}") for value in values],
                "customdata": [touch.counts[i] for i in filled],
                "hovertemplate": "%{x}: %{y}, %{customdata} points",
                "line": {"color": SERIES[k % len(SERIES)], "width": 1.5},
            }
        )
    layout = {
        "height": 360,
        "xaxis": {"type": "category", "title": {"text": "radii from the nearest touched point"}},
        "yaxis": {"title": {"text": "mean squared distance ×10³"}, "rangemode": "tozero"},
        "showlegend": True,
    }
    return {"data": traces, "layout": layout}


def training_charts(history: Sequence[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Line charts of the loss and of the validated metrics over the steps.

    Args:
        history: lines of `metrics.jsonl`; of a step that is written twice, as after a stop, the later one counts.

    Returns:
        Figures by the names `loss` and `validation`; a figure without data is absent.
    """
    steps = {line["step"]: line for line in history if "loss" in line}
    checks = {line["step"]: line["validation"] for line in history if "validation" in line}
    figures = {}
    if steps:
        curves = {"loss": {step: line["loss"] for step, line in steps.items()}}
        parts = sorted({name for line in steps.values() for name in line.get("losses", {})})
        if len(parts) > 1:
            for name in parts:
                curves[name] = {s: line["losses"][name] for s, line in steps.items() if name in line.get("losses", {})}
        figures["loss"] = _figure([_curve(name, values) for name, values in curves.items()], "loss")
    if checks:
        names = sorted({name for values in checks.values() for name in values})
        traces = [
            _curve(name, {step: values[name] for step, values in checks.items() if name in values}, "lines+markers")
            for name in names
        ]
        figures["validation"] = _figure(traces, "validation")
    return figures


def thin(values: dict[int, float]) -> tuple[list[float], list[float]]:
    """Steps and values of a curve, averaged over equal stretches so that at most `DOTS` points remain."""
    steps = np.array(sorted(values), dtype=float)
    heights = np.array([values[int(step)] for step in steps], dtype=float)
    stretches = min(DOTS, len(steps))
    x = [float(part.mean()) for part in np.array_split(steps, stretches)]
    y = [float(part.mean()) for part in np.array_split(heights, stretches)]
    return x, y


def _curve(name: str, values: dict[int, float], mode: str = "lines") -> dict[str, Any]:
    x, y = thin(values)
    rounded = [float(f"{height:.6g}") for height in y]
    return {"type": "scatter", "mode": mode, "name": name, "x": [round(s, 1) for s in x], "y": rounded}


def _figure(traces: list[dict[str, Any]], title: str) -> dict[str, Any]:
    for k, trace in enumerate(traces):
        trace["line"] = {"color": SERIES[k % len(SERIES)], "width": 1.5}
    positive = all(y > 0 for trace in traces for y in trace["y"])
    layout = {
        "height": 320,
        "xaxis": {"title": {"text": "step"}, "rangemode": "tozero"},
        # An adversarial loss may be negative: a logarithmic axis would hide it.
        "yaxis": {"title": {"text": title}, "type": "log" if positive else "linear", "exponentformat": "power"},
        "showlegend": True,
    }
    return {"data": traces, "layout": layout}
