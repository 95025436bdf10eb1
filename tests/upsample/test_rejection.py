"""Candidates are rejected that are too many at a point, and those between two sheets."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pcsr.upsample.rejection import few_each, isolation, on_planes


@given(seed=st.integers(0, 100), count=st.integers(2, 60))
def test_isolation_is_the_distance_to_the_twentieth_other_candidate(seed, count):
    rng = np.random.default_rng(seed)
    candidates, some = rng.normal(size=(count, 3)), rng.permutation(count)[: count // 2]
    unit = rng.uniform(0.5, 2, len(some))
    away = np.sort(np.linalg.norm(candidates[:, None] - candidates, axis=2), axis=1)
    np.testing.assert_allclose(isolation(candidates, some, unit), away[some, min(20, count - 1)] / unit)


def test_candidates_at_points_without_spacing_are_the_most_isolated():
    candidates = np.random.default_rng(0).normal(size=(30, 3))
    assert np.isinf(isolation(candidates, np.arange(30), np.zeros(30))).all()


@given(seed=st.integers(0, 200), most=st.integers(1, 5))
def test_each_point_keeps_its_least_isolated_candidates(seed, most):
    rng = np.random.default_rng(seed)
    nearest, isolated = rng.integers(0, 8, 60), rng.random(60)
    kept = few_each(nearest, most, isolated)
    for point in range(8):
        own = np.flatnonzero(nearest == point)
        assert set(own[kept[own]]) == set(own[np.argsort(isolated[own])][:most])


def test_with_normals_nothing_between_two_sheets_is_kept_and_all_on_them():
    rng = np.random.default_rng(0)
    sheets = [np.column_stack([rng.uniform(0, 20, (400, 2)), np.full(400, z)]) for z in (0.0, 1.4)]
    normals = np.tile([0.0, 0, 1], (800, 1)) * rng.choice([-1, 1], (800, 1))  # of any sign
    candidates = rng.uniform(0, 20, (2000, 3)) * [1, 1, 0.07]
    height = np.minimum(candidates[:, 2], np.abs(candidates[:, 2] - 1.4))
    kept = on_planes(candidates, np.concatenate(sheets), normals, np.ones(800))
    np.testing.assert_array_equal(kept, height <= 0.2)


def test_a_candidate_on_the_other_face_of_an_edge_is_kept():
    rng = np.random.default_rng(0)
    floor, wall = rng.uniform(0, 5, (2, 300, 3)) * [[[1, 1, 0]], [[0, 1, 1]]]
    normals = np.repeat([[0.0, 0, 1], [1, 0, 0]], 300, axis=0)
    candidates = rng.uniform(0, 5, (500, 3)) * [0, 1, 1]
    assert on_planes(candidates, np.concatenate([floor, wall]), normals, np.full(600, 0.3)).all()
