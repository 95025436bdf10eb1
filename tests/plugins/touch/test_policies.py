import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import Fingertip, TouchCandidates
from pcsr.exploration import mean_distances
from pcsr.plugins.loading import load_plugins
from pcsr.testing import check_part
from pcsr_plugins.policies.sparse import NEIGHBOURS
from pcsr_plugins.touch.digit.policies import OPPOSING, PolicyOptions, opposing

NOTHING = np.zeros((0, 3))
TIP = Fingertip("digit", (16.0, 12.0), (27.0, 18.0), 2.0)
POLICIES = ["uniform", "spread", "sparse", "grasp"]


def cloud(count, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 3))


def order(policy, points, touched, seen):
    candidates = TouchCandidates(points, np.stack([np.eye(3)] * len(points)), np.ones(len(points)), TIP)
    return PolicyOptions(use=policy).part().order(candidates, seen, touched)


@pytest.mark.parametrize("policy", [*POLICIES, "expected-error"])
def test_policies_keep_the_contract(policy):
    outcomes = check_part(load_plugins().get("policy", policy))
    assert [one for one in outcomes if one.result == "failed"] == []


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 30), st.integers(1, 12), st.integers(1, 5), st.integers(0, 99))
def test_mean_distances_agree_with_all_distances(points, known, neighbours, seed):
    at, about = cloud(points, seed), cloud(known, seed + 100)
    all_distances = np.sort(np.linalg.norm(at[:, None] - about[None], axis=-1), axis=1)
    np.testing.assert_allclose(mean_distances(at, about, neighbours), all_distances[:, :neighbours].mean(1))


def test_equal_candidates_stay_in_the_order_in_which_they_were_drawn():
    at = np.tile([[1.0, 0, 0], [3.0, 0, 0]], (5, 1))
    assert list(order("spread", at, np.zeros((1, 3)), NOTHING)) == [1, 3, 5, 7, 9, 0, 2, 4, 6, 8]


@pytest.mark.parametrize("policy", POLICIES)
def test_without_known_points_the_order_is_kept(policy):
    assert list(order(policy, cloud(6), NOTHING, NOTHING)) == list(range(6))


def test_policies_use_the_points_that_they_should():
    candidates = np.array([[float(x), 0, 0] for x in range(10)])
    touched, seen = np.array([[0.0, 0, 0]]), np.array([[9.0, 0, 0]])
    for policy in ("uniform", "grasp"):
        assert list(order(policy, candidates, touched, seen)) == list(range(10))
    assert list(order("spread", candidates, touched, seen)) == list(range(9, -1, -1))
    assert list(order("spread", candidates, NOTHING, seen)) == list(range(10))
    # The nearest few of both clouds count: here all of them.
    near = order("sparse", candidates, np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 1, 0]]))
    assert list(near) == list(range(9, -1, -1))


def test_sparse_looks_at_more_than_the_nearest_point():
    stray = np.array([[10.0, 0, 0]])
    crowd = np.random.default_rng(0).normal(scale=0.5, size=(50, 3))
    candidates = np.array([[0.0, 0, 0], [10.0, 0.1, 0]])
    assert NEIGHBOURS > 1
    assert list(order("sparse", candidates, stray, crowd)) == [1, 0]


@pytest.mark.parametrize("housing", [(27.0, 18.0), (20.0, 30.0), (28.0, 28.0)])
@pytest.mark.parametrize("angle", [0.0, 1.0, 4.0])
def test_opposing_fingers_stand_side_by_side_against_the_thumb(housing, angle):
    frame, _ = np.linalg.qr(cloud(3, 5))
    frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
    place = np.array([3.0, -2.0, 7.0])
    starts, axes = opposing(place, frame, housing, 20.0, angle)
    assert starts.shape == (OPPOSING, 3)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(axes[:, 2], -frame[:, 2], atol=1e-12)
    np.testing.assert_allclose(starts[1], place)
    row = (starts[2] - starts[1]) / 20
    np.testing.assert_allclose(starts[1] - starts[0], 20 * row, atol=1e-9)
    assert row @ frame[:, 2] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose([row @ frame[:, 0], row @ frame[:, 1]], [np.cos(angle), np.sin(angle)], atol=1e-12)
    shorter = 0 if housing[0] < housing[1] else 1
    assert abs(axes[:, shorter] @ row) == pytest.approx(1)
