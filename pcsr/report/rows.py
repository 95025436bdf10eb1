"""The rows of a comparison: each recipe with all of its seeds, and each baseline once."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcsr.report.results import BOUND, MethodResult, Results

MARK = "†"
SEED = re.compile(r"-seed\.\d+")


@dataclass(frozen=True)
class Row:
    """A variant, or a baseline."""

    label: str
    clouds: tuple[Any, ...]
    """What it was measured on: only rows of the same can be counted against each other."""
    values: dict[str, np.ndarray]
    """Of each metric, times its scale: a line for each seed, a column for each object."""
    published: dict[str, float]
    parameters: int
    efficiencies: tuple[float | None, ...] | None
    """Touch efficiency of each seed, None for one without touch; None for a baseline."""
    seconds: float
    """For one cloud."""
    epoch: float | None
    """Seconds of training for each epoch, the mean over seeds; None for a baseline and for weights that don't say."""
    bound: bool
    """The floor, which decides no digits."""
    other_code: str | None = None
    """What has changed since its weights were trained, where old weights were measured with new code."""

    @property
    def marked(self) -> str:
        """The label, with a mark where the weights are of other code."""
        return self.label if self.other_code is None else f"{self.label} {MARK}"

    def mean(self, metric: str) -> float:
        """Over objects and seeds."""
        return float(self.values[metric].mean())

    def spread(self, metric: str, *, over_seeds: bool) -> float | None:
        """Sample standard deviation over the seeds' means, or over objects; None where there is but one."""
        values = self.values[metric]
        each = values.mean(1) if over_seeds else values[0]
        return float(each.std(ddof=1)) if len(each) > 1 else None

    def said(self, column: str) -> str:
        """What was published of it, in a line of its own."""
        return f"\npublished {self.published[column]:g}" if column in self.published else ""

    def wins(self, other: "Row", metric: str) -> int | None:
        """Objects on which it is strictly better, in the mean over seeds; None if those were other clouds."""
        if self.clouds != other.clouds:
            return None
        return int((self.values[metric].mean(0) < other.values[metric].mean(0)).sum())


def variants(runs: Sequence[Results], name: str) -> list[Row]:
    """A row for each recipe; runs that differ in nothing but their seed share one."""
    together: dict[str, list[Results]] = {}
    for run in runs:
        same = {key: value for key, value in run.recipe.items() if key not in ("name", "seed")}
        together.setdefault(json.dumps(same, sort_keys=True), []).append(run)
    labels = [SEED.sub("", of_one[0].name).removeprefix(f"{name}-") for of_one in together.values()]
    shared = _shared(labels)
    return [
        _row(
            label.removeprefix(shared),
            [run.methods[0] for run in of_one],
            of_one,
            of_one[0].recipe.get("evaluate", {}).get("published", {}),
        )
        for label, of_one in zip(labels, together.values(), strict=True)
    ]


def _shared(labels: Sequence[str]) -> str:
    """What all labels begin with, up to a hyphen."""
    shared = ""
    for parts in zip(*(label.split("-")[:-1] for label in labels), strict=False):
        if len(labels) < 2 or len(set(parts)) > 1:
            break
        shared += f"{parts[0]}-"
    return shared


def baselines(runs: Sequence[Results]) -> list[Row]:
    """Each baseline once, unless it was measured on other clouds."""
    rows: list[Row] = []
    for run in runs:
        for method in run.methods[1:]:
            rate = f" {run.data.rate}×" if len({other.data.rate for other in runs}) > 1 else ""
            row = _row(method.name + rate, [method], [run], {})
            if not any(
                row.label == old.label and all(np.array_equal(row.values[m], old.values[m]) for m in row.values)
                for old in rows
            ):
                rows.append(row)
    return rows


def _row(label: str, methods: Sequence[MethodResult], runs: Sequence[Results], published: dict[str, float]) -> Row:
    first = runs[0]
    values = {
        metric: np.array([method.values[metric] for method in methods]) * note.scale
        for metric, note in first.metrics.items()
    }
    trained = [run.training.seconds for run in runs if run.training.seconds is not None]
    of_network = methods[0] is first.methods[0]
    return Row(
        label,
        (
            tuple(first.objects),
            first.data.points,
            first.data.truth,
            first.data.sampling,
            *dict.fromkeys(run.data.seed for run in runs),
        ),
        values,
        published,
        methods[0].parameters,
        tuple(run.touch.efficiency if run.touch else None for run in runs) if of_network else None,
        float(np.mean([method.seconds for method in methods])),
        float(np.mean(trained)) / first.recipe["train"]["epochs"] if of_network and trained else None,
        methods[0].name == BOUND and not of_network,
        next((run.training.other_code for run in runs if run.training.other_code), None) if of_network else None,
    )
