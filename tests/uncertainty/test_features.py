"""Features of new points: invariant, and those of a slow computation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.uncertainty.features import FEW, LEAST, NEAREST, Patch, features, of_prediction


def bowl(count=150, seed=0, noise=0.0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.4 * xy[:, 0] ** 2 + 0.2 * xy[:, 1] ** 3 + noise * rng.normal(size=count)])


def patch(points, new, removed=0.0):
    return Patch(points, new, removed)


def every(of):
    return features(of, np.arange(len(of.new)))


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 99), scale=st.sampled_from([1e-6, 0.3, 1.0, 5e4]))
def test_features_are_invariant_to_rotation_translation_scaling_and_order(seed, scale):
    rng = np.random.default_rng(seed)
    points, new = bowl(120, seed, 0.02), bowl(40, seed + 1, 0.05)
    one, unit = every(patch(points, new, 0.01))
    turn, shift = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3)
    order, new_order = rng.permutation(120), rng.permutation(40)
    moved = [scale * (cloud @ turn.T + shift) for cloud in (points[order], new[new_order])]
    other, other_unit = every(patch(*moved, scale * 0.01))
    np.testing.assert_allclose(other_unit, scale * unit[new_order], rtol=1e-6)
    for name, values in one.items():
        np.testing.assert_allclose(other[name], values[new_order], atol=1e-3, err_msg=name)


def test_features_are_those_of_a_slow_computation():
    points, new = bowl(100, noise=0.03), bowl(30, 1, 0.1)
    of = patch(points, new)
    found, unit = every(of)
    for row in (0, 5, 17):
        distance = np.linalg.norm(points - new[row], axis=1)
        nearest = np.argsort(distance)[:NEAREST]
        assert unit[row] == pytest.approx(of.unit[nearest[0]])
        assert np.exp(found["nearest"][row]) - LEAST == pytest.approx(distance[nearest[0]] / unit[row])
        assert np.exp(found["farthest"][row]) - LEAST == pytest.approx(distance[nearest[-1]] / unit[row])
        heights, left = zip(*(slow_quadric(points, of.unit, index, new[row]) for index in nearest), strict=True)
        assert np.exp(found["quadric"][row]) - LEAST == pytest.approx(heights[0] / unit[row], rel=1e-2, abs=1e-4)
        assert np.exp(found["quadric median"][row]) == pytest.approx(np.median(heights) / unit[row] + LEAST, rel=2e-2)
        assert np.exp(found["residual most"][row]) == pytest.approx(max(left) / unit[row] + LEAST, rel=1e-2)
        both = np.concatenate([points, new])
        beside = both[np.argsort(np.linalg.norm(both - new[row], axis=1))[1:13]]
        normal = np.linalg.svd(beside - beside.mean(0))[2][2]
        off = abs((new[row] - beside.mean(0)) @ normal) / unit[row]
        assert np.exp(found["off new"][row]) - LEAST == pytest.approx(off)


def slow_quadric(points, unit, index, new):
    """The distance of a point from the quadric around a known point, and the residual of the quadric."""
    around = points[np.argsort(np.linalg.norm(points - points[index], axis=1))[:16]]
    middle = around.mean(0)
    second, first, normal = np.linalg.svd(around - middle)[2]

    def terms(cloud):
        u, v = ((cloud - points[index]) @ axis for axis in (first, second))
        return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)

    heights = (around - points[index]) @ normal
    coefficients, rest, *_ = np.linalg.lstsq(terms(around), heights)
    off = (new - points[index]) @ normal - terms(new[None])[0] @ coefficients
    return abs(off), np.sqrt(rest[0] / 10)


def test_small_fits_leave_the_noise_and_nothing_on_planes():
    flat = np.column_stack([np.random.default_rng(0).uniform(0, 20, (400, 2)), np.zeros(400)])
    assert patch(flat, flat[:1]).small_planes.max() < 1e-9
    noisy = flat + 0.2 * np.random.default_rng(1).normal(size=flat.shape) * [0, 0, 1]
    of = patch(noisy, noisy[:1])
    for deviation in (of.small_planes, of.small_quadrics):
        assert np.sqrt(np.mean((deviation * of.unit) ** 2)) == pytest.approx(0.2, rel=0.15)


def test_features_of_the_smallest_clouds_and_of_duplicates_are_finite():
    rng = np.random.default_rng(0)
    for points in (
        rng.normal(size=(16, 3)),
        np.repeat(rng.normal(size=(FEW, 3)), 8, axis=0),
        np.outer(range(20), [1.0, 2, 3]),
    ):
        found, _ = every(patch(points, points[:5] + 1e-3))
        assert all(np.isfinite(values).all() for values in found.values())


def test_a_predicted_error_is_a_feature_in_spacings():
    assert of_prediction(np.array([0.2]), np.array([2.0]))[0] == pytest.approx(np.log(0.1 + LEAST))
