"""Expected errors of new points: calibrated, equivariant, and the same however the cloud is divided."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

import pcsr
from pcsr import UserError
from pcsr.uncertainty import errors_of, expected, expected_errors
from pcsr.workers import worker_pool


def sphere(count, seed=0, noise=0.0):
    """Points of a sphere of radius 10, with noise along the radius."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points * (10 + noise * rng.normal(size=(count, 1)))


def off(points):
    return np.abs(np.linalg.norm(points, axis=1) - 10)


@pytest.mark.parametrize("noise", [0.1, 0.2])
@pytest.mark.parametrize("count", [800, 2000])
def test_about_68_percent_of_the_points_lie_within_their_errors(count, noise):
    points = sphere(count, noise=noise)
    new = pcsr.load("midpoint").upsample(points, rate=4)[count:]
    errors = expected_errors(points, new)
    assert 0.5 < (off(new) <= errors).mean() < 0.85
    assert np.median(errors) < 2 * noise


def test_errors_are_larger_where_points_are_farther_from_the_surface():
    points = sphere(1000)
    on, above = sphere(50, seed=1), sphere(50, seed=1) * 1.08
    assert np.median(expected_errors(points, above)) > 3 * np.median(expected_errors(points, on))


def test_errors_scale_with_the_cloud_and_do_not_depend_on_its_frame():
    points, new = sphere(300, noise=0.1), sphere(200, 1, 0.2)
    errors = expected_errors(points, new)
    turn = Rotation.random(random_state=0).as_matrix()
    for scale, shift in ((1e-200, 0.0), (1e3, 1e7), (1e200, 0.0)):
        moved = [scale * (cloud @ turn.T) + shift for cloud in (points, new)]
        np.testing.assert_allclose(expected_errors(*moved), scale * errors, rtol=1e-3)
    order = np.random.default_rng(0).permutation(200)
    np.testing.assert_allclose(expected_errors(points[::-1], new[order]), errors[order], rtol=1e-6)


def test_predicted_errors_count_where_there_are_some():
    points, new = sphere(300), sphere(100, 1)
    plain = expected_errors(points, new)
    np.testing.assert_array_equal(expected_errors(points, new, predicted=np.zeros(100)), plain)
    small, large = (expected_errors(points, new, predicted=np.full(100, error)) for error in (0.01, 0.8))
    assert np.median(large) > np.median(small)
    half = np.repeat([0.0, 0.3], 50)
    mixed = expected_errors(points, new, predicted=half)
    np.testing.assert_allclose(mixed[:50], plain[:50])
    assert (mixed[50:] != plain[50:]).all()


def test_patches_give_nearly_the_errors_of_the_whole(monkeypatch):
    points, new = sphere(3000, noise=0.05), sphere(1500, 1, 0.1)
    none = np.zeros(1500)
    whole = errors_of(points, new, none)
    monkeypatch.setattr(expected, "SIZE", 1000)
    monkeypatch.setattr(expected, "CORE", 700)
    calls = []
    parts = errors_of(points, new, none, advance=lambda done, total: calls.append((done, total)))
    ratio = parts.new / whole.new
    assert np.median(np.abs(np.log(ratio))) < 0.1
    assert parts.new.min() > 0, "no point is left out"
    assert len(calls) > 3
    assert calls[-1] == (3000, 3000)
    assert len(set(parts.known)) == len(calls), "each patch has its own noise"


def test_points_beyond_the_core_are_neighbourhood_only():
    points, new = sphere(600, noise=0.05), sphere(300, 1)
    inner = np.argsort(points[:, 0])
    points, new = points[inner], new[new[:, 0] < -1]
    whole = errors_of(points, new, np.zeros(len(new)))
    core = errors_of(points, new, np.zeros(len(new)), core=400)
    np.testing.assert_allclose(core.new, whole.new)
    assert len(core.known) == 400


@pytest.mark.slow
def test_processes_give_the_same_errors(monkeypatch):
    points, new = sphere(5000, noise=0.05), sphere(500, 1)
    with worker_pool(2) as pool:
        other = errors_of(points, new, np.zeros(500), pool=pool)
    one = errors_of(points, new, np.zeros(500))
    np.testing.assert_array_equal(one.new, other.new)
    np.testing.assert_array_equal(one.known, other.known)


def test_noise_is_the_error_of_the_known_points():
    assert (errors_of(sphere(1500), sphere(10, 1), np.zeros(10)).known == 0).all()
    known = errors_of(sphere(1500, noise=0.3), sphere(10, 1), np.zeros(10)).known
    np.testing.assert_allclose(known, 0.3, rtol=0.2)


def test_clouds_of_every_kind_and_duplicates_are_taken():
    points, new = sphere(100), sphere(20, 1)
    errors = expected_errors(points, new)
    assert errors.shape == (20,)
    np.testing.assert_allclose(expected_errors(torch.from_numpy(points), torch.from_numpy(new)), errors)
    np.testing.assert_allclose(expected_errors(np.concatenate([points, points]), new), errors)
    assert expected_errors(points, np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize(
    ("points", "new", "predicted", "said"),
    [
        (sphere(15), sphere(5), None, r"the cloud has 15 points: at least 16 are needed"),
        (sphere(20), sphere(5), np.zeros(4), r"predicted has shape \(4,\) for 5 new points: give one number for each"),
        (sphere(20), sphere(5), np.full(5, -1.0), "predicted has numbers that are negative or not finite: give 0"),
        (sphere(20), np.full((2, 3), np.nan), None, "the new points"),
        (np.ones((20, 3)), sphere(5), None, "the cloud has 1 points"),
    ],
)
def test_what_cannot_be_used_is_refused(points, new, predicted, said):
    with pytest.raises(UserError, match=said):
        expected_errors(points, new, predicted=predicted)


def test_far_from_the_cloud_the_error_is_at_least_the_distance_beyond():
    far = np.array([[0.0, 0.0, 100.0], [0.0, 0.0, 1e6], [0.0, 0.0, 0.0]])
    errors = expected_errors(sphere(800), far)
    assert (errors > np.array([80, 0.99e6, 5])).all()
