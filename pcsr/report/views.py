"""The 3-D views of an example, as plotly traces: what came in, what was felt, what came out, what is true."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.report.results import Cloud, Example

DECIMALS = 4
"""Of coordinates and errors: 10⁻⁴ of the unit sphere is less than a pixel, and keeps the page small."""
ERROR_SCALE = 1000
COLOURS: list[tuple[float, str]] = [(0.0, "#7f9bb5"), (0.5, "#e3a02e"), (1.0, "#d0202b")]
"""From unobtrusive to alarming; each stands out from white and from black."""


def views(example: Example) -> dict[str, Any]:
    """The row of views of one example, plain data for the page's script.

    Returns:
        name: of the object.
        limit: the error at the end of the row's one colour scale, ×10⁻³.
        range: lowest and highest coordinate for each axis, a cube that holds every view.
        views: titles, and the plotly traces under them.
    """
    errors = {name: distance(cloud, example.truth) * ERROR_SCALE for name, cloud in example.predictions.items()}
    limit = scale_end(list(errors.values()))
    shown = [view(f"input, {len(example.input)} points", plain(example.input, "input", 3.0))]
    if example.touches is not None:
        shown.append(
            view(
                f"touches, {len(example.touches)} points",
                plain(example.input, "quiet", 2.5),
                plain(example.touches, "touch", 2.0),
            )
        )
    for name, cloud in example.predictions.items():
        mean = float(errors[name].mean())
        shown.append(view(f"{name}, mean error {mean:.3g} ×10⁻³", _coloured(cloud, errors[name], limit)))
    shown.append(view(f"truth, {len(example.truth)} points", plain(example.truth, "truth", 1.6)))
    return {"name": example.name, "limit": limit, "range": cube(*_held(example)), "views": shown}


def distance(prediction: Float[np.ndarray, "n 3"], truth: Cloud) -> Float[np.ndarray, " n"]:
    """Distance of each predicted point to the nearest truth point."""
    return np.asarray(cKDTree(truth.astype(np.float64)).query(prediction.astype(np.float64), workers=1)[0])


def scale_end(errors: Sequence[Float[np.ndarray, " _"]]) -> float:
    """The end of a colour scale: a single stray point would otherwise make all others look perfect."""
    return float(np.percentile(np.concatenate(errors), 99)) or 1.0


def view(title: str, *traces: dict[str, Any]) -> dict[str, Any]:
    """One view: its title and what it shows."""
    return {"title": title, "traces": list(traces)}


def plain(cloud: Cloud, colour: str, size: float) -> dict[str, Any]:
    """Points of one colour, which the page's style sheet gives under this name."""
    return {**_points(cloud), "marker": {"size": size, "color": colour}, "hoverinfo": "skip"}


def _coloured(cloud: Float[np.ndarray, "n 3"], errors: Float[np.ndarray, " n"], limit: float) -> dict[str, Any]:
    return {
        **_points(cloud),
        "marker": {
            "size": 1.8,
            "color": np.round(errors, 2).tolist(),
            "cmin": 0,
            "cmax": limit,
            "colorscale": COLOURS,
        },
        "hovertemplate": "%{marker.color} ×10⁻³<extra></extra>",
    }


def _points(cloud: Cloud) -> dict[str, Any]:
    # Rounded as doubles: the nearest float32 to 0.1235 would be written with ten digits.
    x, y, z = np.round(cloud.astype(np.float64), DECIMALS).T.tolist()
    return {"type": "scatter3d", "mode": "markers", "x": x, "y": y, "z": z}


def _held(example: Example) -> list[Cloud]:
    """What every view must hold; strays of a prediction may fall outside."""
    return [cloud for cloud in (example.input, example.touches, example.truth) if cloud is not None]


def cube(*clouds: Cloud) -> list[list[float]]:
    """One range for all views, so that one camera means the same in each."""
    held = np.concatenate(clouds)
    low, high = held.min(0).astype(np.float64), held.max(0).astype(np.float64)
    middle, half = (low + high) / 2, float((high - low).max()) / 2 * 1.05 or 1.0
    return [[round(float(m) - half, DECIMALS), round(float(m) + half, DECIMALS)] for m in middle]
