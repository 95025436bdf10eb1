"""Scores of one run: the numbers that the page and the terminal both show."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcsr.metrics.touch_effect import EXCHANGED
from pcsr.report.tables.significance import clear_best, pairwise
from pcsr.results import BOUND, Results


@dataclass(frozen=True)
class Score:
    """One method's result in one metric, multiplied by the metric's scale."""

    mean: float
    deviation: float
    """Sample standard deviation over the objects; 0 for a single one."""
    best: bool
    """Whether this is the significantly lowest mean of the column (`significance.RULE`), not counting the floor's."""
    wins: int | None
    """Objects on which this method is strictly better than the baseline; None for the baseline itself."""
    change: float | None
    """Difference from the baseline's mean, as a fraction of it: -0.2 is a fifth lower. None as for `wins`."""
    decimals: int
    """Decimals that give the smallest mean of the column three significant digits."""

    def __str__(self) -> str:
        return f"{self.mean:.{self.decimals}f} ± {self.deviation:.{self.decimals}f}"


def scores(results: Results) -> list[dict[str, Score]]:
    """Scores of each method, by metric, in the order of `results.methods`."""
    rows: list[dict[str, Score]] = [{} for _ in results.methods]
    for metric, note in results.metrics.items():
        values = np.array([m.values[metric] for m in results.methods]) * note.scale
        means = values.mean(1)
        rivals = np.flatnonzero([method.name != BOUND for method in results.methods])
        winner = clear_best(values[rivals], pairwise(values[rivals]))
        best = None if winner is None else results.methods[rivals[winner]]
        deviations = values.std(1, ddof=1) if values.shape[1] > 1 else np.zeros(len(values))
        decimals = decimals_of(float(means[rivals].min()))
        for row, method, own, mean, deviation in zip(rows, results.methods, values, means, deviations, strict=True):
            compared = results.baseline not in (None, method.name)
            row[metric] = Score(
                float(mean),
                float(deviation),
                method is best,
                int((own < values[1]).sum()) if compared else None,
                float(mean / means[1] - 1) if compared and means[1] > 0 else None,
                decimals,
            )
    return rows


def group_means(results: Results, metric: str) -> dict[str, list[float]]:
    """Scaled mean of a metric over each group, one number for each method; groups in alphabetical order."""
    groups = np.array(results.groups)
    values = np.array([m.values[metric] for m in results.methods]) * results.metrics[metric].scale
    return {str(g): values[:, groups == g].mean(1).tolist() for g in np.unique(groups)}


def scaled(metric: str, scale: int | float) -> str:
    """Heading of a metric with its scale: ``cd ×10³``."""
    if scale == 1:
        return metric
    power = math.log10(scale)
    if power == int(power):
        return f"{metric} ×10{str(int(power)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    return f"{metric} ×{scale:g}"


def efficiency_cell(values: Sequence[float | None], exchanged: Sequence[float | None] = ()) -> str:
    """Touch efficiencies of one recipe's seeds: mean ± sample standard deviation; a dash without touch.

    Those with another object's touches, if there are any, are on a second line.
    """
    known = np.array([value for value in values if value is not None])
    spread = f" ± {known.std(ddof=1):.3f}" if len(known) > 1 else ""
    text = f"{known.mean():z.3f}{spread}" if len(known) else "–"
    of_others = [value for value in exchanged if value is not None]
    return f"{text}\n{EXCHANGED} {np.mean(of_others):z.3f}" if of_others else text


def decimals_of(smallest: float) -> int:
    """Decimals that give the smallest number of a column three significant digits."""
    return max(0, 2 - math.floor(math.log10(smallest))) if smallest > 0 else 3
