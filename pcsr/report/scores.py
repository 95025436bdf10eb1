"""The numbers that the page and the screen both show."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcsr.report.results import BOUND, Results


@dataclass(frozen=True)
class Score:
    """One cell of the table, times the metric's scale."""

    mean: float
    deviation: float
    """Sample standard deviation over the objects; 0 for a single one."""
    best: bool
    """The lowest mean of the column, not counting the floor's."""
    wins: int | None
    """Objects on which this method is strictly better than the baseline; None for the baseline itself."""
    change: float | None
    """The mean beside the baseline's, as a share of it: -0.2 is a fifth lower. None as for `wins`."""
    decimals: int
    """As many as give the smallest mean of the column three significant digits."""

    def __str__(self) -> str:
        return f"{self.mean:.{self.decimals}f} ± {self.deviation:.{self.decimals}f}"


def scores(results: Results) -> list[dict[str, Score]]:
    """The cells of the table: for each method, its score in each metric."""
    rows: list[dict[str, Score]] = [{} for _ in results.methods]
    for metric, note in results.metrics.items():
        values = np.array([m.values[metric] for m in results.methods]) * note.scale
        means = values.mean(1)
        rivals = means[[method.name != BOUND for method in results.methods]]
        deviations = values.std(1, ddof=1) if values.shape[1] > 1 else np.zeros(len(values))
        decimals = decimals_of(float(rivals.min()))
        for row, method, own, mean, deviation in zip(rows, results.methods, values, means, deviations, strict=True):
            compared = results.baseline not in (None, method.name)
            row[metric] = Score(
                float(mean),
                float(deviation),
                len(rivals) > 1 and method.name != BOUND and bool(mean == rivals.min()),
                int((own < values[1]).sum()) if compared else None,
                float(mean / means[1] - 1) if compared and means[1] > 0 else None,
                decimals,
            )
    return rows


def group_means(results: Results, metric: str) -> dict[str, list[float]]:
    """The scaled mean of a metric over each group, one for each method; groups in alphabetical order."""
    groups = np.array(results.groups)
    values = np.array([m.values[metric] for m in results.methods]) * results.metrics[metric].scale
    return {str(g): values[:, groups == g].mean(1).tolist() for g in np.unique(groups)}


def scaled(metric: str, scale: float) -> str:
    """The heading of a metric: ``cd ×10³``."""
    if scale == 1:
        return metric
    power = math.log10(scale)
    if power == int(power):
        return f"{metric} ×10{str(int(power)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    return f"{metric} ×{scale:g}"


def efficiency_cell(values: Sequence[float | None]) -> str:
    """The touch efficiencies of one recipe's seeds: their mean ± sample standard deviation; a dash without touch."""
    known = np.array([value for value in values if value is not None])
    spread = f" ± {known.std(ddof=1):.3f}" if len(known) > 1 else ""
    return f"{known.mean():z.3f}{spread}" if len(known) else "–"


def decimals_of(smallest: float) -> int:
    """As many as give the smallest number of a column three significant digits."""
    return max(0, 2 - math.floor(math.log10(smallest))) if smallest > 0 else 3
