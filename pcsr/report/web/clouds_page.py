"""Interactive HTML page of any clouds, side by side under one camera."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from pcsr.report.clouds.colouring import SOURCE, SOURCE_COLOURS, Classes, Scale
from pcsr.report.clouds.shown import Scene, ShownCloud, rows_of
from pcsr.report.colours import MARK, VALUE_SCALE
from pcsr.report.web.document import document, example_tabs, table
from pcsr.report.web.views import plain, points_of, view

ROW = 12
"""Largest number of views in a row: browsers show about 16 at a time. More clouds take several rows."""
THEMED = dict(zip(SOURCE_COLOURS, ("truth", "input", "touch"), strict=True))
"""Names in page.css of the colours that have one: they differ in a dark room."""
MARKER = "pcsr-clouds"
"""Class that marks the pages of this module, so that a page is not written over another file."""


def clouds_page(scene: Scene, *, plotly: str) -> str:
    """HTML page of clouds.

    Args:
        scene: the clouds.
        plotly: source of plotly.js.
    """
    rows = [scene.clouds[k : k + ROW] for k in range(0, len(scene.clouds), ROW)]
    names = [row[0].name if len(row) == 1 else f"{row[0].name} … {row[-1].name}" for row in rows]
    examples = [
        {"name": name, "range": [[-1, 1]] * 3, "views": [_view(scene, cloud) for cloud in row]}
        for name, row in zip(names, rows, strict=True)
    ]
    first = scene.clouds[0].name
    title = first if len(scene.clouds) == 1 else f"{first} and {len(scene.clouds) - 1} more"
    lead = "Drag to turn the view" if len(scene.clouds) == 1 else "Turning one view turns all"
    tabs = f"<nav>{example_tabs(names)}</nav>" if len(rows) > 1 else ""
    notes = "".join(f'<p class="note">{html.escape(note)}</p>' for note in scene.notes)
    body = (
        f'<h1 class="{MARKER}">{html.escape(title)}</h1>'
        f'<p class="lead">{lead}; double-click to turn back.</p>'
        f'<section id="examples">{tabs}<div class="row clouds"></div>{_key(scene)}</section>{notes}'
        f"<section><h2>Clouds</h2>{_table(scene.clouds)}</section>"
    )
    return document(title, body, {"examples": examples, "charts": {}}, plotly=plotly)


def _view(scene: Scene, cloud: ShownCloud) -> dict[str, Any]:
    """View of a cloud, with the touches."""
    points, size = cloud.cube.scaled(cloud.points), _size(len(cloud.points))
    key, colours = scene.colours.key, cloud.colours
    traces = []
    if colours is None:
        traces.append(plain(points, "truth", size))
    elif isinstance(key, Scale):
        known = np.isfinite(colours)
        traces.append(_on_scale(points[known], colours[known], key, size))
        traces.append(plain(points[~known], "quiet", size))
    elif isinstance(key, Classes):
        for label, colour, rows in rows_of(cloud, key):
            trace = plain(points[rows], THEMED.get(colour, colour), size)
            # Only a column's values and pcsr's own words are labels: no markup for plotly.
            del trace["hoverinfo"]
            traces.append({**trace, "hovertemplate": f"{label}<extra></extra>"})
        traces.append(plain(points[colours < 0], "quiet", size))
    else:
        listed = [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in colours.tolist()]
        traces.append({**points_of(points), "marker": {"size": size, "color": listed}, "hoverinfo": "skip"})
    touched = scene.touched[cloud.cube.holds(scene.touched)]
    traces.append(plain(cloud.cube.scaled(touched), MARK, size))
    return view(cloud.caption, *(trace for trace in traces if trace["x"]))


def _on_scale(points: np.ndarray, values: np.ndarray, scale: Scale, size: float) -> dict[str, Any]:
    numbers = [float(f"{value:.5g}") for value in values]
    # A scale from a number to the same number has no colours.
    low, high = (scale.low, scale.high) if scale.low < scale.high else (scale.low - 0.5, scale.high + 0.5)
    marker = {"size": size, "color": numbers, "cmin": low, "cmax": high, "colorscale": VALUE_SCALE}
    return {**points_of(points), "marker": marker, "hovertemplate": "%{marker.color}<extra></extra>"}


def _size(count: int) -> float:
    """Size of a point in pixels."""
    return float(np.clip(90 / max(count, 1) ** 0.5, 1.2, 4.0).round(1))


def _key(scene: Scene) -> str:
    """The scale of colours, or the list of classes; and the colour of touches."""
    key, scale = scene.colours.key, ""
    parts: list[tuple[str, str]] = []
    if isinstance(key, Scale):
        gradient = ", ".join(f"{colour} {100 * fraction:g}%" for fraction, colour in VALUE_SCALE)
        scale = (
            f'<div class="scale"><span>{html.escape(key.name)}</span><span>{key.low:.5g}</span>'
            f'<i style="background: linear-gradient(to right, {gradient})"></i><span>{key.high:.5g}</span></div>'
        )
    elif isinstance(key, Classes):
        used = {label for cloud in scene.clouds for label, _, _ in rows_of(cloud, key)}
        listed = zip(key.labels, key.colours, strict=True)
        parts = [(label, THEMED.get(colour, colour)) for label, colour in listed if label in used]
        scale = "" if key.name == SOURCE else f'<p class="note">{html.escape(key.name)}:</p>'
    if len(scene.touched):
        parts.append((f"recorded touches, {len(scene.touched):,} points", MARK))
    items = "".join(
        f'<li><i style="background: {colour if colour.startswith("#") else f"var(--{colour})"}"></i>'
        f"{html.escape(label)}</li>"
        for label, colour in parts
    )
    return scale + (f'<ul class="legend">{items}</ul>' if items else "")


def _table(clouds: Sequence[ShownCloud]) -> str:
    """Table of the clouds: points, size and lowest corner."""
    rows = []
    for cloud in clouds:
        size = " × ".join(f"{side:.4g}" for side in cloud.high - cloud.low)
        corner = ", ".join(f"{value:.9g}" for value in cloud.low)
        rows.append([html.escape(cloud.name), f"{cloud.total:,}", f"{len(cloud.points):,}", size, corner])
    return table(["cloud", "points", "shown", "size x × y × z", "lowest x, y, z"], rows)
