"""Statistics of paired differences: bootstrap interval of the mean, Wilcoxon's signed-rank test, Holm's correction.

Two methods are compared on the same objects, so each object has one difference. Where a method has several seeds, the
values of an object are averaged over them first: objects are independent of each other, the seeds' values of one object
are not.
"""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Float

LEVEL = 0.05
"""Level of significance of the corrected p-values."""
CONFIDENCE = 0.95
"""Confidence of the intervals."""
RESAMPLES = 10_000
"""Number of bootstrap samples, of which each second one mirrors the one before."""
SEED = 0
"""Seed of the bootstrap samples."""
BLOCK = 500
"""Number of bootstrap samples that are in memory at a time."""
RULE = (
    f"Bold: the lowest mean of a column, if it is significantly lower than the second lowest (Wilcoxon signed-rank "
    f"test over the objects, p < {LEVEL:g} after Holm's correction for all pairs of rows)"
)
"""Rule by which the best of a column is marked, for captions."""


def interval(differences: Float[np.ndarray, " objects"]) -> tuple[float, float] | None:
    """Compute the 95 % confidence interval of the mean by a bootstrap over the objects.

    The interval is the expanded percentile interval of Hesterberg ("What Teachers Should Know About the Bootstrap",
    The American Statistician 69, 2015): quantiles of the means of `RESAMPLES` samples, at tail probabilities
    that make up for the narrowness of percentile intervals of few objects. The samples are drawn by position in the
    sorted differences, and with each sample its mirror image is used. The interval therefore does not depend on the
    order of the objects, and that of the negated differences is the negated interval.

    Args:
        differences: one for each object.

    Returns:
        Lower and upper end; None for a single object.
    """
    from scipy import stats  # it takes half a second, and most commands need no statistics

    count = len(differences)
    if count < 2:
        return None
    ordered = np.sort(differences)
    rng = np.random.default_rng(SEED)
    means = []
    for _ in range(RESAMPLES // (2 * BLOCK)):
        chosen = rng.integers(count, size=(BLOCK, count))
        means += [ordered[chosen].mean(1), ordered[count - 1 - chosen].mean(1)]
    quantile = stats.t.ppf((1 - CONFIDENCE) / 2, count - 1) * math.sqrt(count / (count - 1))
    tail = float(stats.norm.cdf(quantile))
    low, high = np.quantile(np.concatenate(means), [tail, 1 - tail])
    return float(low), float(high)


def signed_rank(differences: Float[np.ndarray, " objects"]) -> float:
    """Compute the two-sided p-value of Wilcoxon's signed-rank test that differences are symmetric around 0.

    Objects without a difference do not count; without any other object the p-value is 1.

    Args:
        differences: one for each object.
    """
    from scipy import stats

    different = differences[differences != 0]
    return float(stats.wilcoxon(different).pvalue) if len(different) else 1.0


def holm(p_values: Sequence[float]) -> list[float]:
    """Correct p-values of several tests by Holm's step-down method (Scand. J. Statist. 6, 1979).

    Args:
        p_values: one for each test, in any order.

    Returns:
        Corrected p-values in the same order, at most 1.

    Examples:
        >>> holm([0.01, 0.04, 0.03])
        [0.03, 0.06, 0.06]
    """
    corrected = [0.0] * len(p_values)
    largest = 0.0
    for rank, k in enumerate(sorted(range(len(p_values)), key=lambda k: p_values[k])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[k]))
        corrected[k] = largest
    return corrected


def pairwise(values: Float[np.ndarray, "rows objects"]) -> Float[np.ndarray, "rows rows"]:
    """Compute the p-value of each pair of rows by `signed_rank`, corrected by `holm` for the number of pairs.

    Args:
        values: one value for each row and object.

    Returns:
        Symmetric matrix with ones on the diagonal.
    """
    pairs = list(combinations(range(len(values)), 2))
    p_values = holm([signed_rank(values[i] - values[j]) for i, j in pairs])
    matrix = np.ones((len(values), len(values)))
    for (i, j), p_value in zip(pairs, p_values, strict=True):
        matrix[i, j] = matrix[j, i] = p_value
    return matrix


def clear_best(values: Float[np.ndarray, "rows objects"], p_values: Float[np.ndarray, "rows rows"]) -> int | None:
    """Return the row with the lowest mean if it is significantly lower than the second lowest, by `RULE`.

    Args:
        values: one value for each row and object; lower is better.
        p_values: result of `pairwise`.

    Returns:
        Index of the row; None if no row is clearly the best, or if there is only one.
    """
    if len(values) < 2:
        return None
    best, second, *_ = values.mean(1).argsort(kind="stable")
    return int(best) if p_values[best, second] < LEVEL else None


def smallest_p(objects: int, rows: int) -> float:
    """Return the smallest corrected p-value that a comparison of this size can have.

    Args:
        objects: number of objects; with all differences of the same sign Wilcoxon's test has p = 2 / 2^objects.
        rows: number of rows that are compared with each other.
    """
    return min(1.0, math.comb(rows, 2) * 2.0 ** (1 - objects))
