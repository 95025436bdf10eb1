"""Statistics of paired differences, against naive twins and by their properties."""

import random
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from pcsr.report.tables.significance import (
    CONFIDENCE,
    LEVEL,
    clear_best,
    holm,
    interval,
    pairwise,
    signed_rank,
    smallest_p,
)

DIFFERENCES = arrays(np.float64, st.integers(2, 12), elements=st.floats(-1e3, 1e3, width=32))
P_VALUES = st.lists(st.floats(0, 1), min_size=1, max_size=8)


def bootstrapped(differences, tail, resamples=4000):
    """Percentiles of the means of plain bootstrap samples."""
    draw = random.Random(7)
    means = sorted(statistics.fmean(draw.choices(differences, k=len(differences))) for _ in range(resamples))
    return means[round(tail * resamples)], means[round((1 - tail) * resamples) - 1]


@pytest.mark.parametrize("count", [8, 24, 100])
def test_the_interval_is_that_of_a_plain_loop(count):
    student = stats.t(count - 1).ppf((1 + CONFIDENCE) / 2)
    tail = 1 - statistics.NormalDist().cdf((count / (count - 1)) ** 0.5 * student)
    assert tail < (1 - CONFIDENCE) / 2, "wider than percentiles"
    differences = np.random.default_rng(count).gamma(2.0, 0.5, count) - 0.7
    low, high = interval(differences)
    spread = differences.std() / np.sqrt(count)
    for end, plain in zip((low, high), bootstrapped(differences.tolist(), tail), strict=True):
        assert abs(end - plain) < 0.2 * spread


def test_nineteen_of_twenty_intervals_hold_the_mean():
    rng = np.random.default_rng(0)
    for count, expected in ((8, 0.94), (24, 0.945)):
        held = [low <= 0.5 <= high for low, high in (interval(rng.normal(0.5, 1.0, count)) for _ in range(400))]
        assert np.mean(held) == pytest.approx(expected, abs=0.03)


@given(DIFFERENCES, st.randoms(use_true_random=False))
def test_the_order_of_the_objects_does_not_count(differences, order):
    shuffled = differences.tolist()
    order.shuffle(shuffled)
    assert interval(np.array(shuffled)) == interval(differences)
    assert signed_rank(np.array(shuffled)) == pytest.approx(signed_rank(differences), rel=1e-9)


@given(DIFFERENCES)
def test_exchanged_methods_have_the_negated_interval_and_the_same_p(differences):
    low, high = interval(differences)
    scale = np.abs(differences).max()
    assert interval(-differences) == (pytest.approx(-high, abs=1e-12 * scale), pytest.approx(-low, abs=1e-12 * scale))
    assert signed_rank(-differences) == pytest.approx(signed_rank(differences), rel=1e-9)
    assert low <= differences.mean() + 1e-9 * scale
    assert high >= differences.mean() - 1e-9 * scale


def test_a_single_object_has_no_interval_and_equal_ones_a_narrow_one():
    assert interval(np.array([0.5])) is None
    assert interval(np.full(6, 0.25)) == (0.25, 0.25)


@given(DIFFERENCES)
def test_the_test_is_scipys_without_the_objects_that_do_not_differ(differences):
    p = signed_rank(differences)
    if not differences.any():
        assert p == 1
    else:
        assert p == pytest.approx(stats.wilcoxon(differences[differences != 0]).pvalue)


@pytest.mark.parametrize("count", [1, 3, 8])
def test_differences_of_one_sign_are_as_unlikely_as_as_many_coins(count):
    assert signed_rank(np.arange(1.0, count + 1)) == pytest.approx(2 / 2**count)
    assert smallest_p(count, 2) == pytest.approx(2 / 2**count)


def test_exact_p_of_a_small_case_by_hand():
    # Of the 16 signs of the ranks 1 to 4, those with a rank sum of 1 or less on either side: {}, {1} and mirrored.
    assert signed_rank(np.array([-1.0, 2.0, 3.0, 4.0])) == pytest.approx(4 / 16)


def test_holm_by_hand():
    # sorted: 0.005·4, 0.01·3, 0.03·2, 0.04·1 -> 0.02, 0.03, 0.06, at least the one before: 0.06
    assert holm([0.04, 0.005, 0.03, 0.01]) == pytest.approx([0.06, 0.02, 0.06, 0.03])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


@given(P_VALUES)
def test_holms_p_rejects_what_the_step_down_procedure_rejects(p_values):
    rejected = set()
    for rank, k in enumerate(sorted(range(len(p_values)), key=lambda k: p_values[k])):
        if p_values[k] * (len(p_values) - rank) >= LEVEL:
            break
        rejected.add(k)
    corrected = holm(p_values)
    assert {k for k, p in enumerate(corrected) if p < LEVEL} == rejected
    assert all(raw <= p <= min(1.0, raw * len(p_values)) + 1e-15 for raw, p in zip(p_values, corrected, strict=True))


def test_pairs_of_rows_are_one_family():
    values = np.random.default_rng(3).normal(size=(4, 15)) + np.arange(4)[:, None]
    matrix = pairwise(values)
    assert (matrix == matrix.T).all()
    assert (matrix.diagonal() == 1).all()
    pairs = [(i, j) for i in range(4) for j in range(i)]
    expected = holm([signed_rank(values[i] - values[j]) for i, j in pairs])
    assert [matrix[pair] for pair in pairs] == pytest.approx(expected)


def test_the_best_is_clear_only_if_it_is_significantly_better_than_the_second():
    rng = np.random.default_rng(0)
    base = rng.uniform(1, 2, 12)
    near, far = base + rng.normal(0, 0.1, 12), base + 1
    for values, best in (([far, base - 0.5, near], 1), ([near, base, far], None), ([base], None), ([base, base], None)):
        rows = np.array(values)
        assert clear_best(rows, pairwise(rows)) == best


def test_too_few_objects_can_show_nothing():
    assert smallest_p(5, 2) > LEVEL > smallest_p(6, 2)
    assert smallest_p(2, 30) == 1
    values = np.arange(5.0) + 10 * np.arange(2)[:, None]
    assert pairwise(values)[0, 1] == pytest.approx(smallest_p(5, 2))
    assert clear_best(values, pairwise(values)) is None
