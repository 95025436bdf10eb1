"""Rows of a comparison: each recipe with all of its seeds, and each baseline once."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.results import BOUND, MethodResult, Results

MARK = "†"
"""Mark of a row whose weights were trained with other code."""
SEED = re.compile(r"-seed\.\d+")


@dataclass(frozen=True)
class Row:
    """A recipe or a baseline, with its results for all seeds."""

    label: str
    clouds: tuple[Any, ...]
    """Identity of the test clouds: wins are counted only between rows of the same clouds."""
    values: dict[str, Float[np.ndarray, "seeds objects"]]
    """Values of each metric, multiplied by its scale."""
    published: dict[str, float]
    """Published values by column."""
    parameters: int
    efficiencies: tuple[float | None, ...] | None
    """Touch efficiency of each seed, None for a seed without touch; None for a baseline."""
    seconds: float
    """Wall time for one cloud, mean over seeds."""
    epoch: float | None
    """Wall time of a training epoch in seconds, mean over seeds; None for a baseline and where it is not known."""
    bound: bool
    """Whether the row is the floor, which is not used to choose decimals."""
    other_code: str | None = None
    """How the code differs from that of the training, where old weights were measured with new code."""
    protocol: str | None = None
    """Name of the way in which the network makes a cloud dense; None for a baseline and where it is not known."""

    @property
    def marked(self) -> str:
        """The label, with `MARK` if the weights were trained with other code."""
        return self.label if self.other_code is None else f"{self.label} {MARK}"

    def mean(self, metric: str) -> float:
        """Mean over objects and seeds."""
        return float(self.values[metric].mean())

    def spread(self, metric: str, *, over_seeds: bool) -> float | None:
        """Sample standard deviation over the seeds' means, or over objects; None for a single one."""
        values = self.values[metric]
        each = values.mean(1) if over_seeds else values[0]
        return float(each.std(ddof=1)) if len(each) > 1 else None

    def published_line(self, column: str) -> str:
        """The published value of a column on a new line; empty if there is none."""
        return f"\npublished {self.published[column]:g}" if column in self.published else ""

    def wins(self, other: "Row", metric: str) -> int | None:
        """Objects on which this row is strictly better, in the mean over seeds; None if the clouds differ."""
        if self.clouds != other.clouds:
            return None
        return int((self.values[metric].mean(0) < other.values[metric].mean(0)).sum())


def variants(runs: Sequence[Results], name: str) -> list[Row]:
    """Rows of the recipes; runs that differ only in their seed share one.

    Args:
        runs: at least one.
        name: name of the study, which is removed from the labels.
    """
    by_recipe: dict[str, list[Results]] = {}
    for run in runs:
        settings = {key: value for key, value in run.recipe.items() if key not in ("name", "seed")}
        by_recipe.setdefault(json.dumps(settings, sort_keys=True), []).append(run)
    labels = [SEED.sub("", seeds[0].name).removeprefix(f"{name}-") for seeds in by_recipe.values()]
    prefix = _common_prefix(labels)
    return [
        _row(
            label.removeprefix(prefix),
            [run.methods[0] for run in seeds],
            seeds,
            seeds[0].settings.published,
        )
        for label, seeds in zip(labels, by_recipe.values(), strict=True)
    ]


def _common_prefix(labels: Sequence[str]) -> str:
    """Common beginning of all labels, up to a hyphen."""
    parts = zip(*(label.split("-")[:-1] for label in labels), strict=False)
    equal = takewhile(lambda of_all: len(set(of_all)) == 1, parts)
    return "".join(f"{first}-" for first, *_ in equal) if len(labels) > 1 else ""


def baselines(runs: Sequence[Results]) -> list[Row]:
    """Rows of the baselines: each once, or once for each set of test clouds."""
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
    epochs = [seconds for run in runs if (seconds := run.seconds_per_epoch) is not None]
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
        float(np.mean(epochs)) if of_network and epochs else None,
        methods[0].name == BOUND and not of_network,
        next((run.training.other_code for run in runs if run.training.other_code), None) if of_network else None,
        first.protocol if of_network else None,
    )
