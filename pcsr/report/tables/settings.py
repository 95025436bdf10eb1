"""Table of the settings in which the recipes of a comparison differ."""

import json
from typing import Any

from pcsr.report.tables.comparison import Comparison
from pcsr.report.tables.text_table import TextTable
from pcsr.results import Results

LEFT_OUT = ("name", "seed", "evaluate")
"""Beginnings of the settings that do not affect a network, except by chance."""


def settings_that_differ(compared: Comparison) -> TextTable | None:
    """Table of the settings in which the recipes differ, a column for each section; None if they differ in none."""
    rows = [row for row in compared.rows if row.efficiencies is not None]
    settings = [_settings(row.runs[0]) for row in rows]
    keys = dict.fromkeys(key for of_row in settings for key in of_row if not key.startswith(LEFT_OUT))
    different = [key for key in keys if len({json.dumps(of_row.get(key)) for of_row in settings}) > 1]
    if not different:
        return None
    sections = list(dict.fromkeys(key.partition(".")[0] for key in different))
    cells = []
    for row, of_row in zip(rows, settings, strict=True):
        lines: dict[str, list[str]] = {section: [] for section in sections}
        for key in different:
            section, _, inner = key.partition(".")
            if of_row.get(key) is not None:
                lines[section].append(f"{inner.removesuffix('.use')} {of_row[key]}".strip())
        cells.append([row.marked, *("\n".join(lines[section]) for section in sections)])
    return TextTable("What differs", ["", *sections], cells, "All other settings are the same, except seeds.")


def _settings(run: Results) -> dict[str, Any]:
    """Settings of a run by dotted key, with the seed of the data and the version of pcsr."""
    flat = _flat(run.recipe) | {"version.pcsr": run.version}
    if flat.get("data.seed") is None and run.data.seed is not None:
        flat["data.seed"] = run.data.seed
    return flat


def _flat(node: Any, prefix: str = "") -> dict[str, Any]:
    """Nested settings as dotted keys."""
    if not (isinstance(node, dict) and node):
        return {prefix: node}
    flat: dict[str, Any] = {}
    for key, value in node.items():
        flat |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return flat
