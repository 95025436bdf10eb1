"""The flat charts, as plotly figures: a metric by group of objects, and the course of the training."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from pcsr.report.results import Results, TouchResult
from pcsr.report.scores import group_means, scaled

COLOURS = ["#2a78b8", "#e08a1e", "#2e9e6b", "#b5548f", "#8a6fd1", "#7a7a7a"]
"""One for each method, in the order of the table; each legible on white and on black."""
DOTS = 500
"""At most so many along a curve: more than that can't be told apart on a screen."""


def group_chart(results: Results, metric: str) -> dict[str, Any]:
    """Horizontal bars, methods side by side; the groups hardest for the first method at the top."""
    means = sorted(group_means(results, metric).items(), key=lambda item: -item[1][0])
    traces = [
        {
            "type": "bar",
            "orientation": "h",
            # plotly reads names as markup
            "name": html.escape(method.name, quote=False),
            "y": [html.escape(group, quote=False) for group, _ in means],
            "x": [round(values[k], 4) for _, values in means],
            "marker": {"color": COLOURS[k % len(COLOURS)]},
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
        # Reversed, so that the first method is the upper bar of a pair as it is the first of the legend.
        "yaxis": {"type": "category", "autorange": "reversed"},
        "legend": {"traceorder": "normal"},
    }
    return {"data": traces, "layout": layout}


def touch_chart(touch: TouchResult) -> dict[str, Any]:
    """The error by distance to the nearest touched point, a line for each cloud; empty bins are left out."""
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
                "line": {"color": COLOURS[k % len(COLOURS)], "width": 1.5},
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
    """The loss, and each validated metric, over the steps.

    Args:
        history: the lines of `metrics.jsonl`; of a step written twice, as after a stop, the later counts.

    Returns:
        Figures under the names `loss` and `validation`; one without data is absent.
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
    """Steps and values, averaged over equal stretches so that at most `DOTS` remain."""
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
        trace["line"] = {"color": COLOURS[k % len(COLOURS)], "width": 1.5}
    positive = all(y > 0 for trace in traces for y in trace["y"])
    layout = {
        "height": 320,
        "xaxis": {"title": {"text": "step"}, "rangemode": "tozero"},
        # An adversarial loss may be negative, and a logarithm then hides it.
        "yaxis": {"title": {"text": title}, "type": "log" if positive else "linear", "exponentformat": "power"},
        "showlegend": True,
    }
    return {"data": traces, "layout": layout}
