"""Whether a cloud shows an object from all sides."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr.registration.sides import shows_all_sides


def sphere(count=512):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return 20 * points / np.linalg.norm(points, axis=1, keepdims=True)


def box(count=600):
    """Points on the surface of a box of 30 × 20 × 10."""
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (count, 3))
    axis = rng.choice(3, count, p=np.array([2, 3, 6]) / 11)
    points[np.arange(count), axis] = rng.choice([-1, 1], count)
    return points * [15, 10, 5]


@pytest.mark.parametrize("cloud", [sphere(), box(), sphere(20_000)], ids=["sphere", "box", "dense sphere"])
def test_a_closed_surface_shows_all_sides_and_half_of_it_does_not(cloud):
    assert shows_all_sides(cloud)
    assert not shows_all_sides(cloud[cloud[:, 2] > 0.1 * cloud[:, 2].max()])


def test_a_terrain_has_no_other_side():
    xy = np.random.default_rng(2).uniform(-30, 30, (1000, 2))
    assert not shows_all_sides(np.column_stack([xy, 2 * np.sin(xy[:, 0] / 4)]))


def test_neither_frame_nor_unit_nor_copies_matter():
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    for cloud in (box(), box()[box()[:, 2] > 0]):
        expected = shows_all_sides(cloud)
        assert shows_all_sides(1e-3 * cloud @ turn.T + 5) == expected
        assert shows_all_sides(np.concatenate([cloud, cloud])) == expected


def test_too_few_points_show_nothing():
    assert not shows_all_sides(sphere(12))
