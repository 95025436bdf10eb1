"""The report of a run: one page with its table, its clouds and its training curve."""

import json
from pathlib import Path
from statistics import fmean
from typing import Any

from safetensors import SafetensorError, safe_open

from pcsr.errors import UserError
from pcsr.files import write_text
from pcsr.report.page import page
from pcsr.report.table import table
from pcsr.report.views import examples

__all__ = ["table", "write"]


def write(run: Path) -> Path:
    """Write `report.html` into a run folder, from what `pcsr run` left there.

    Raises:
        UserError: a file is missing or damaged.
    """
    results_path, examples_path = run / "results.json", run / "examples.safetensors"
    try:
        results = json.loads(results_path.read_text(encoding="utf-8"))
        methods = [method["name"] for method in results["methods"]]
        with safe_open(examples_path, "np") as file:
            names = json.loads(file.metadata()["names"])
        data = {
            "examples": examples(examples_path, names, methods),
            "groups": _groups(results),
            "curve": _curve(run / "metrics.jsonl"),
        }
    except (OSError, ValueError, KeyError, TypeError, SafetensorError) as error:
        raise UserError(
            f"{run} is not the folder of a finished run ({type(error).__name__}: {error}): do `pcsr run` again"
        ) from error
    path = run / "report.html"
    write_text(path, page(results, data))
    return path


def _groups(results: dict[str, Any]) -> dict[str, Any]:
    """Means of the first metric for each group of objects."""
    metric, about = next(iter(results["metrics"].items()))
    names = sorted(set(results["groups"]))
    values = [
        [
            round(about["scale"] * fmean(v for v, g in zip(m["values"][metric], results["groups"], strict=True) if g == name), 4)
            for name in names
        ]
        for m in results["methods"]
    ]
    title = f"{metric} ×{about['scale']}"
    return {"metric": title, "names": names, "values": values, "methods": [m["name"] for m in results["methods"]]}


def _curve(history: Path) -> list[dict[str, Any]]:
    """Loss and validation as plotly traces; nothing if the weights were shipped."""
    if not history.exists():
        return []
    lines = [json.loads(line) for line in history.read_text(encoding="utf-8").splitlines()]
    steps = [line for line in lines if "loss" in line]
    checks = [line for line in lines if "validation" in line]
    thin = max(1, len(steps) // 2000)
    return [
        {"name": "loss", "mode": "lines", "x": [s["step"] for s in steps[::thin]], "y": [s["loss"] for s in steps[::thin]]},
        {"name": "validation cd", "mode": "lines+markers", "x": [c["step"] for c in checks], "y": [c["validation"]["cd"] for c in checks]},
    ]
