import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pcsr.metrics.auction import assign

CASES = {
    "two random clouds": lambda rng, n: (rng.random((n, 3)), rng.random((n, 3))),
    "one spot": lambda rng, n: (np.ones((n, 3)), rng.normal(size=(n, 3))),
    "two spots": lambda rng, n: (np.eye(3)[rng.integers(0, 2, n)], rng.normal(size=(n, 3))),
    "a clump": lambda rng, n: (rng.normal(size=(n, 3)) * 0.02, rng.normal(size=(n, 3))),
    "every point eight times": lambda rng, n: (np.repeat(rng.random((n // 8, 3)), 8, 0), rng.random((n, 3))),
    "the same few spots, unequally": lambda rng, n: (
        np.eye(3)[np.arange(n) * 2 // n],
        np.eye(3)[np.arange(n) * 3 // n],
    ),
    "far apart": lambda rng, n: (rng.random((n, 3)), rng.random((n, 3)) + 100),
}


def least_mean(a, b):
    cost = cdist(a, b)
    return cost[linear_sum_assignment(cost)].mean()


def check(a, b, tolerance):
    held, bound = assign(a, b, tolerance)
    mean, exact = np.linalg.norm(a - b[held], axis=1).mean(), least_mean(a, b)
    assert sorted(held) == list(range(len(b)))
    assert bound <= exact * (1 + 1e-9) + 1e-12
    assert exact * (1 - 1e-9) - 1e-12 <= mean <= exact / (1 - tolerance) + 1e-9
    return mean, exact


@pytest.mark.parametrize("case", CASES)
def test_an_auction_comes_as_near_to_the_optimum_as_it_says(case):
    check(*CASES[case](np.random.default_rng(0), 400), 0.01)


def test_an_auction_of_many_points_agrees_with_the_exact_solver():
    rng = np.random.default_rng(0)
    mean, exact = check(rng.random((1500, 3)), rng.random((1500, 3)), 0.01)
    assert mean == pytest.approx(exact, rel=1e-3)


@given(st.integers(3, 30), st.integers(1, 4), st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_a_tight_tolerance_gives_the_optimum_also_on_a_lattice_full_of_ties(n, side, seed):
    a, b = np.random.default_rng(seed).integers(0, side, (2, n, 3)).astype(float)
    check(a, b, 1e-6)


def test_the_same_clouds_give_the_same_assignment():
    a, b = np.random.default_rng(0).random((2, 300, 3))
    assert np.array_equal(assign(a, b, 0.01)[0], assign(a, b, 0.01)[0])
