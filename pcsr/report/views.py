"""The 3-D views of the report: one example at a time, its clouds side by side, all turned together."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from safetensors.numpy import load_file
from scipy.spatial import cKDTree

Cloud = Float[np.ndarray, "n 3"]


def examples(path: Path, names: list[str], methods: list[str]) -> list[dict[str, Any]]:
    """The examples as data for the page's script.

    Each is `{name, views}`, a view being `{title, clouds}`, a cloud `{x, y, z, error?, role}`; errors are distances
    to the nearest point of the truth, ×10³.
    """
    clouds = load_file(path)
    shown = []
    for k, name in enumerate(names):
        truth = clouds[f"{k}/truth"]
        seen = [_cloud(clouds[f"{k}/input"], "input")]
        if f"{k}/touches" in clouds:
            seen.append(_cloud(clouds[f"{k}/touches"], "touch"))
        views = [{"title": "input and touches" if len(seen) > 1 else "input", "clouds": seen}]
        tree = cKDTree(truth)
        for method in methods:
            dense = clouds[f"{k}/{method}"]
            error = 1000 * tree.query(dense)[0]
            views.append({"title": method, "clouds": [_cloud(dense, "dense", error)]})
        views.append({"title": "truth", "clouds": [_cloud(truth, "truth")]})
        shown.append({"name": name, "views": views})
    return shown


def _cloud(points: Cloud, role: str, error: Float[np.ndarray, " n"] | None = None) -> dict[str, Any]:
    data: dict[str, Any] = {axis: np.round(points[:, i], 3).tolist() for i, axis in enumerate("xyz")}
    data["role"] = role
    if error is not None:
        data["error"] = np.round(error, 1).tolist()
    return data
