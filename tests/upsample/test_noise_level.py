"""The estimated noise is that which was added; details and thin sheets are none."""

import numpy as np
import pytest

from pcsr.upsample.noise_level import noise_level


def surface(kind, count, seed=0):
    """Points of a surface, about 1 apart."""
    rng = np.random.default_rng(seed)
    if kind == "plane":
        return rng.uniform(0, np.sqrt(count), (count, 3)) * [1, 1, 0]
    if kind == "ball":
        points = rng.normal(size=(count, 3))
        return np.sqrt(count / (4 * np.pi)) * points / np.linalg.norm(points, axis=1, keepdims=True)
    half = np.sqrt(count / 24)
    points = rng.uniform(-half, half, (count, 3))
    points[np.arange(count), rng.integers(0, 3, count)] = rng.choice([-half, half], count)
    return points


def sorted_rows(points):
    return points[np.lexsort(points.T)]


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.4])
@pytest.mark.parametrize("count", [1000, 4000])
@pytest.mark.parametrize("kind", ["plane", "ball", "box"])
def test_the_level_is_right_within_15_percent(kind, count, noise):
    cloud = surface(kind, count)
    cloud += noise * np.random.default_rng(1).normal(size=cloud.shape)
    assert noise_level(sorted_rows(cloud)) == pytest.approx(noise, rel=0.15)


@pytest.mark.parametrize("count", [200, 1000])
@pytest.mark.parametrize("kind", ["plane", "ball", "box"])
def test_without_noise_the_level_is_zero(kind, count):
    assert noise_level(sorted_rows(surface(kind, count))) == 0


def test_details_that_are_too_small_for_the_points_are_no_noise():
    cloud = surface("plane", 1500)
    cloud[:, 2] = 0.5 * np.sin(cloud[:, 0]) * np.sin(cloud[:, 1])
    assert noise_level(sorted_rows(cloud)) == 0


def test_thin_sheets_are_no_noise():
    cloud = np.concatenate([surface("plane", 700), surface("plane", 700, 1) + np.array([0, 0, 0.8])])
    assert noise_level(sorted_rows(cloud)) == 0


def test_of_a_few_points_there_is_no_estimate():
    cloud = surface("plane", 40)
    cloud[:, 2] = np.random.default_rng(1).normal(0, 0.2, 40)
    assert noise_level(cloud) == 0
