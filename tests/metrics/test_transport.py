import numpy as np
import ot
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pcsr.metrics import transport
from pcsr.metrics.transport import mean_distance

CASES = {
    "two random clouds": lambda rng, n: (rng.random((n, 3)), rng.random((n, 3))),
    "one spot": lambda rng, n: (np.ones((n, 3)), rng.normal(size=(n, 3))),
    "one spot each": lambda rng, n: (np.ones((n, 3)), np.zeros((n, 3))),
    "two spots": lambda rng, n: (np.eye(3)[rng.integers(0, 2, n)], rng.normal(size=(n, 3))),
    "two tight clumps": lambda rng, n: (
        np.eye(3)[rng.integers(0, 2, n)] + 1e-7 * rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)),
    ),
    "half of it in a few spots": lambda rng, n: (
        np.concatenate([rng.normal(size=(n // 2, 3)), rng.normal(size=(8, 3))[rng.integers(0, 8, n - n // 2)]]),
        rng.normal(size=(n, 3)),
    ),
    "every point eight times": lambda rng, n: (np.repeat(rng.random((n // 8, 3)), 8, 0), rng.random((n, 3))),
    "the same few spots, unequally": lambda rng, n: (
        np.eye(3)[np.arange(n) * 2 // n],
        np.eye(3)[np.arange(n) * 3 // n],
    ),
    "the same cloud": lambda rng, n: (np.eye(3)[np.arange(n) % 3] * n, np.eye(3)[np.arange(n) % 3][::-1] * n),
    "far apart": lambda rng, n: (rng.random((n, 3)), rng.random((n, 3)) + 100),
}


def least_mean(a, b):
    cost = cdist(a, b)
    return cost[linear_sum_assignment(cost)].mean()


def check(a, b, tolerance):
    mean, bound = mean_distance(a, b, tolerance)
    exact = least_mean(a, b)
    extent = np.linalg.norm(np.ptp(np.concatenate([a, b]), axis=0))
    assert bound <= exact + 1e-9 * extent
    assert exact - 1e-9 * extent <= mean <= exact / (1 - tolerance) + 1e-9 * extent
    return mean, exact


@pytest.mark.parametrize("case", CASES)
def test_the_mean_comes_as_near_to_the_least_as_it_says(case):
    check(*CASES[case](np.random.default_rng(0), 400), 1e-4)


def test_clouds_of_many_points_agree_with_the_dense_solver():
    rng = np.random.default_rng(0)
    mean, exact = check(rng.random((1500, 3)), rng.random((1500, 3)), 0.0)
    assert mean == pytest.approx(exact, rel=1e-9)


@given(st.integers(1, 40), st.integers(1, 4), st.integers(0, 99))
@settings(max_examples=60)
def test_without_tolerance_it_is_the_optimum_also_on_a_lattice_full_of_ties(n, side, seed):
    a, b = np.random.default_rng(seed).integers(0, side, (2, n, 3)).astype(float)
    check(a, b, 0.0)


def test_missing_pairs_are_found_and_added(monkeypatch):
    """With one pair a point to begin with and one more a round, it takes longer and ends at the same value."""
    rng = np.random.default_rng(0)
    a, b = rng.random((300, 3)), rng.random((300, 3)) ** 2
    solved, emd = [], ot.emd

    def noted(of_a, of_b, cost, **options):
        if not isinstance(cost, np.ndarray):  # that of the cells is dense
            solved.append(cost.nnz)
        return emd(of_a, of_b, cost, **options)

    monkeypatch.setattr(transport, "FIRST", 1)
    monkeypatch.setattr(transport, "MORE", 1)
    monkeypatch.setattr(ot, "emd", noted)
    mean, exact = check(a, b, 0.0)
    assert mean == pytest.approx(exact, rel=1e-9)
    assert len(solved) > 2
    assert solved == sorted(set(solved))


def test_the_same_clouds_give_the_same_value():
    a, b = np.random.default_rng(0).random((2, 300, 3))
    assert mean_distance(a, b, 1e-4) == mean_distance(a, b, 1e-4)


@pytest.mark.parametrize("scale", [1e-300, 1e-100, 1e-18, 1e-9, 1e6, 1e100, 1e300])
def test_the_unit_does_not_matter(scale):
    a, b = np.random.default_rng(0).random((2, 200, 3))
    mean, bound = mean_distance(a, b, 0.0)
    scaled = mean_distance(scale * a, scale * b, 0.0)
    assert scaled[0] == pytest.approx(scale * mean, rel=1e-9)
    assert scaled[1] == pytest.approx(scale * bound, rel=1e-9)


@pytest.mark.parametrize("tolerance", [-1.0, float("nan")])
def test_a_tolerance_that_nothing_meets_ends_at_the_optimum(tolerance):
    a, b = np.random.default_rng(0).random((2, 200, 3))
    assert mean_distance(a, b, tolerance)[0] == pytest.approx(least_mean(a, b), rel=1e-9)
