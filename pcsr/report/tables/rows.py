"""Rows of a comparison: each recipe with all of its seeds, and each baseline once."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count, takewhile

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.report.tables.same_clouds import same_clouds
from pcsr.results import BOUND, MethodResult, MetricNote, Results

MARK = "†"
"""Mark of a row whose weights were trained with other code."""
SEED = re.compile(r"-seed\.\d+")


@dataclass(frozen=True)
class Row:
    """A recipe or a baseline, with its results for all seeds."""

    label: str
    runs: tuple[Results, ...]
    """Results of each seed."""
    values: dict[str, Float[np.ndarray, "seeds objects"]]
    """Values of each metric, multiplied by its scale."""
    published: dict[str, float]
    """Published values by column."""
    parameters: int
    efficiencies: tuple[float | None, ...] | None
    """Touch efficiency of each seed, None for a seed without touch; None for a baseline."""
    exchanged: tuple[float | None, ...]
    """Touch efficiency of each seed with the touches of another object; None where it was not measured."""
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
    def seeds(self) -> list[int]:
        """Seeds of the runs."""
        return [run.seed for run in self.runs]

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

    def of_objects(self, metric: str) -> Float[np.ndarray, " objects"]:
        """Value of each object, mean over seeds."""
        return self.values[metric].mean(0)  # type: ignore[no-any-return]

    def comparable(self, other: "Row") -> bool:
        """Whether both rows were measured on the same clouds, so that their values are paired by object."""
        everything = (*self.runs, *other.runs)
        if all(same_clouds(everything[0], run) for run in everything[1:]):
            return True
        pairs = zip(self.runs, other.runs, strict=False)  # the clouds change with the seed
        return self.seeds == other.seeds and all(same_clouds(*pair) for pair in pairs)


def shared_metrics(runs: Sequence[Results]) -> dict[str, MetricNote]:
    """Metrics that all runs have, in the order of the first run.

    Raises:
        UserError: there is none.
    """
    shared = {name: note for name, note in runs[0].metrics.items() if all(name in run.metrics for run in runs)}
    if not shared:
        listed = "; ".join(f"{run.name}: {', '.join(run.metrics)}" for run in runs[:5])
        raise UserError(f"the runs have no metric in common ({listed}): evaluate them with the same evaluate.metrics")
    return shared


def variants(runs: Sequence[Results], name: str) -> list[Row]:
    """Rows of the recipes; runs that differ only in their seed share one.

    Args:
        runs: at least one.
        name: name of the study, which is removed from the labels.
    """
    by_recipe: dict[tuple[str, int], list[Results]] = {}
    for run in runs:
        settings = {key: value for key, value in run.recipe.items() if key not in ("name", "seed", "evaluate")}
        text = json.dumps([settings, run.objects], sort_keys=True)
        # A second run of the same recipe and seed is a row of its own.
        number = next(k for k in count() if all(run.seed != other.seed for other in by_recipe.get((text, k), ())))
        by_recipe.setdefault((text, number), []).append(run)
    recipes = [sorted(seeds, key=lambda run: run.seed) for seeds in by_recipe.values()]
    labels = _labels([SEED.sub("", seeds[0].name).removeprefix(f"{name}-") for seeds in recipes])
    return [
        _row(label, [run.methods[0] for run in seeds], seeds, seeds[0].settings.published)
        for label, seeds in zip(labels, recipes, strict=True)
    ]


def _labels(names: Sequence[str]) -> list[str]:
    """Labels of rows: without the common beginning of all names, and numbered where a name occurs again."""
    prefix = _common_prefix(names)
    labels: list[str] = []
    for name in names:
        label = name.removeprefix(prefix)
        labels.append(next(one for k in count(1) if (one := f"{label} ({k})" if k > 1 else label) not in labels))
    return labels


def _common_prefix(labels: Sequence[str]) -> str:
    """Common beginning of all labels, up to a hyphen that is not within a value, such as `fusion.cross-attention`.

    Nothing if a label without values is the beginning of all, such as `pu-gcn` of `pu-gcn-touch`: it may be a name with
    hyphens.
    """
    shortest = min(labels, key=len)
    named = "." not in shortest and all(label == shortest or label.startswith(f"{shortest}-") for label in labels)
    if named or len(labels) < 2:
        return ""
    parts = zip(*(label.split("-")[:-1] for label in labels), strict=False)
    equal = [first for first, *_ in takewhile(lambda of_all: len(set(of_all)) == 1, parts)]
    while equal and "." in equal[-1] and not all("." in label.split("-")[len(equal)] for label in labels):
        equal.pop()
    return "".join(f"{part}-" for part in equal)


def baselines(runs: Sequence[Results]) -> list[Row]:
    """Rows of the baselines: each once, or once for each set of test clouds."""
    rows: list[Row] = []
    for run in runs:
        for method in run.methods[1:]:
            rate = f" {run.data.rate}×" if len({other.data.rate for other in runs}) > 1 else ""
            row = _row(method.name + rate, [method], [run], {})
            if not any(
                row.label == old.label
                and all(np.allclose(row.values[m], old.values[m]) for m in row.values.keys() & old.values.keys())
                for old in rows
            ):
                rows.append(row)
    return rows


def _row(label: str, methods: Sequence[MethodResult], runs: Sequence[Results], published: dict[str, float]) -> Row:
    first = runs[0]
    values = {
        metric: np.array([method.values[metric] for method in methods]) * note.scale
        for metric, note in shared_metrics(runs).items()
    }
    epochs = [seconds for run in runs if (seconds := run.seconds_per_epoch) is not None]
    of_network = methods[0] is first.methods[0]
    return Row(
        label,
        tuple(runs),
        values,
        published,
        methods[0].parameters,
        tuple(run.touch.efficiency if run.touch else None for run in runs) if of_network else None,
        tuple(run.touch.exchanged_efficiency if run.touch else None for run in runs) if of_network else (),
        float(np.mean([method.seconds for method in methods])),
        float(np.mean(epochs)) if of_network and epochs else None,
        methods[0].name == BOUND and not of_network,
        next((run.training.other_code for run in runs if run.training.other_code), None) if of_network else None,
        first.protocol if of_network else None,
    )
