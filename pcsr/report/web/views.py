"""3-D views of an example as plotly traces: input, touches, predictions and truth."""

from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.report.cloud_errors import SCALE, distance, scale_end
from pcsr.report.colours import ERROR_SCALE
from pcsr.run_files import Cloud, Example
from pcsr.uncertainty import expected_errors
from pcsr.upsample.dense import FEWEST

DECIMALS = 4
"""Decimals of coordinates: 10⁻⁴ of the unit sphere is less than a pixel."""


def views(example: Example) -> dict[str, Any]:
    """Row of views of one example, as plain data for page.js.

    Returns:
        A dict with `name`, that of the object; `limit`, the error at the end of the row's colour scale, ×10⁻³;
        `range`, lowest and highest coordinate for each axis, a cube around all clouds; and `views`, each with a title
        and its plotly traces. The first prediction is shown by its expected errors too.
    """
    errors = {name: distance(cloud, example.truth) * SCALE for name, cloud in example.predictions.items()}
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
    for number, (name, cloud) in enumerate(example.predictions.items()):
        mean = float(errors[name].mean())
        shown.append(
            view(f"{name}, mean distance to the truth {mean:.3g} ×10⁻³", _coloured(cloud, errors[name], limit))
        )
        if number == 0 and len(example.input) >= FEWEST:
            expected = SCALE * expected_errors(example.input, cloud)
            title = f"expected error of {name}, mean {expected.mean():.3g} ×10⁻³"
            shown.append(view(title, _coloured(cloud, expected, limit)))
    shown.append(view(f"truth, {len(example.truth)} points", plain(example.truth, "truth", 1.6)))
    return {"name": example.name, "limit": limit, "range": cube(*_held(example)), "views": shown}


def view(title: str, *traces: dict[str, Any]) -> dict[str, Any]:
    """A view: its title and its plotly traces."""
    return {"title": title, "traces": list(traces)}


def plain(cloud: Float[np.ndarray, "n 3"], colour: str, size: float) -> dict[str, Any]:
    """Trace of points in one colour, a name of page.css or ``#rrggbb``."""
    return {**points_of(cloud), "marker": {"size": size, "color": colour}, "hoverinfo": "skip"}


def _coloured(cloud: Float[np.ndarray, "n 3"], errors: Float[np.ndarray, " n"], limit: float) -> dict[str, Any]:
    return {
        **points_of(cloud),
        "marker": {
            "size": 1.8,
            "color": np.round(errors, 2).tolist(),
            "cmin": 0,
            "cmax": limit,
            "colorscale": ERROR_SCALE,
        },
        "hovertemplate": "%{marker.color} ×10⁻³<extra></extra>",
    }


def points_of(cloud: Float[np.ndarray, "n 3"]) -> dict[str, Any]:
    """Trace of points without colour and size."""
    # Rounded as doubles: the nearest float32 to 0.1235 would be written with ten digits.
    x, y, z = np.round(cloud.astype(np.float64), DECIMALS).T.tolist()
    return {"type": "scatter3d", "mode": "markers", "x": x, "y": y, "z": z}


def _held(example: Example) -> list[Cloud]:
    """Clouds that every view must show whole; outliers of a prediction may be outside."""
    return [cloud for cloud in (example.input, example.touches, example.truth) if cloud is not None]


def cube(*clouds: Cloud) -> list[list[float]]:
    """Range of each axis for a cube around the clouds, so that one camera fits all views."""
    held = np.concatenate(clouds)
    low, high = held.min(0).astype(np.float64), held.max(0).astype(np.float64)
    middle, half = (low + high) / 2, float((high - low).max()) / 2 * 1.05 or 1.0
    return [[round(float(m) - half, DECIMALS), round(float(m) + half, DECIMALS)] for m in middle]
