"""Numbers of a comparison of several runs: rows, paired differences from the first row, and the best of each metric."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcsr.report.tables.rows import Row, baselines, shared_metrics, variants
from pcsr.report.tables.significance import clear_best, interval, pairwise
from pcsr.results import MetricNote, Results


@dataclass(frozen=True)
class Difference:
    """Paired difference of a row from the first one in one metric, multiplied by the metric's scale."""

    mean: float
    """Mean over objects of the row's value minus the first row's; negative where the row is better."""
    interval: tuple[float, float] | None
    """95 % confidence interval of the mean; None for a single object."""
    p_value: float | None
    """Corrected p-value of the signed-rank test; None for the floor, which is no method."""
    wins: int
    """Objects on which the row is strictly better, in the mean over seeds."""
    better_seeds: int | None
    """Seeds with which the row's mean is lower; None unless both rows have the same seeds."""


@dataclass(frozen=True)
class Comparison:
    """Several runs, in rows."""

    name: str
    """Name of the study."""
    runs: tuple[Results, ...]
    metrics: dict[str, MetricNote]
    """Metrics that all runs have."""
    rows: tuple[Row, ...]
    """The recipes, then the baselines. Differences are from the first."""
    differences: dict[str, tuple[Difference | None, ...]]
    """For each metric and row; None for the first row and for rows of other clouds."""
    best: dict[str, int | None]
    """For each metric, the row that is significantly better than the second best; None if there is none."""
    tested: int
    """Number of rows that are tested against each other: those on the clouds of the first row, without the floor."""
    left_out: tuple[str, ...] = ()
    """Reasons why runs are missing, one for each."""

    @property
    def first(self) -> Row:
        """Row that the others are compared with."""
        return self.rows[0]

    @property
    def over_seeds(self) -> bool:
        """Whether spreads are over seeds; otherwise they are over objects."""
        return any(len(row.runs) > 1 for row in self.rows)


def comparison(runs: Sequence[Results], name: str, left_out: Sequence[str] = ()) -> Comparison:
    """Compute the numbers of a comparison.

    Args:
        runs: at least one.
        name: name of the study.
        left_out: reasons why runs are missing, one for each.

    Raises:
        UserError: the runs have no metric in common.
    """
    metrics = shared_metrics(runs)
    rows = [*variants(runs, name), *baselines(runs)]
    paired = [k for k, row in enumerate(rows) if k == 0 or row.comparable(rows[0])]
    tested = [k for k in paired if not rows[k].bound]
    same = all(k in paired for k, row in enumerate(rows) if not row.bound)
    differences: dict[str, tuple[Difference | None, ...]] = {}
    best: dict[str, int | None] = {}
    for metric in metrics:
        values = np.stack([rows[k].of_objects(metric) for k in tested])
        p_values = pairwise(values)
        winner = clear_best(values, p_values) if same else None
        best[metric] = None if winner is None else tested[winner]
        of_first = dict(zip(tested, p_values[0].tolist(), strict=True))
        differences[metric] = tuple(
            _difference(rows[k], rows[0], metric, of_first.get(k)) if k in paired and k else None
            for k in range(len(rows))
        )
    return Comparison(name, tuple(runs), metrics, tuple(rows), differences, best, len(tested), tuple(left_out))


def _difference(row: Row, first: Row, metric: str, p_value: float | None) -> Difference:
    each = row.of_objects(metric) - first.of_objects(metric)
    by_seed = row.values[metric].mean(1) < first.values[metric].mean(1) if row.seeds == first.seeds else None
    return Difference(
        float(each.mean()),
        interval(each),
        p_value,
        int((each < 0).sum()),
        None if by_seed is None or len(row.seeds) == 1 else int(by_seed.sum()),
    )
