"""A simulated camera sees the near side, on the surface, and says when there is nothing to see."""

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr.data.view import seen_points, spread_directions
from pcsr.recipe import View

BALL = trimesh.creation.icosphere(subdivisions=4, radius=5.0).apply_translation([100.0, -20.0, 3.0])
CENTRE = np.array([100.0, -20.0, 3.0])


def seen(mesh, count=512, seed=0, **view):
    return seen_points(mesh, count, View(**view), np.random.default_rng(seed), "part-3")


def test_points_lie_on_the_surface_and_are_all_different():
    points = seen(BALL)
    assert points.shape == (512, 3)
    _, distance, _ = trimesh.proximity.closest_point_naive(BALL, points[::8])
    assert distance.max() < 1e-6
    assert len(np.unique(points, axis=0)) == 512


def test_one_camera_sees_no_more_than_the_cap_in_sight():
    points = (seen(BALL, 2000) - CENTRE) / 5
    axis = points.mean(0) / np.linalg.norm(points.mean(0))
    # From three radii away a sphere is seen down to a height of a third of its radius.
    assert (points @ axis).min() == pytest.approx(1 / 3, abs=0.06)
    assert (points @ axis).min() > 0.27


def test_more_cameras_see_more_of_it():
    shares = []
    for cameras in (1, 2, 6):
        points = (seen(BALL, 4000, cameras=cameras) - CENTRE) / 5
        directions = spread_directions(400, np.random.default_rng(1))
        shares.append(((directions @ points.T).max(1) > 0.98).mean())
    assert shares[0] < 0.45 < shares[1] < shares[2]
    assert shares[2] > 0.85


def test_what_stands_in_front_hides_what_is_behind():
    hidden = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    alone = seen(trimesh.util.concatenate([trimesh.creation.box((0.1, 0.1, 4)), hidden]), 3000, cameras=6)
    boxed = seen(trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), hidden]), 3000, cameras=6)
    assert (np.linalg.norm(alone, axis=1) < 0.6).any()
    assert np.abs(np.abs(boxed).max(1) - 1).max() < 1e-6


def test_noise_moves_points_along_the_line_of_sight():
    exact, noisy = seen(BALL), seen(BALL, noise=0.01)
    far = np.abs(np.linalg.norm(noisy - CENTRE, axis=1) - 5)
    assert np.abs(np.linalg.norm(exact - CENTRE, axis=1) - 5).max() < 0.05
    radius = np.linalg.norm(BALL.vertices - BALL.bounds.mean(0), axis=1).max()
    assert 0.3 * 0.01 * radius < far.std() < 1.5 * 0.01 * radius
    assert far.max() > 0.05


def test_the_same_seed_sees_the_same_and_another_something_else():
    np.testing.assert_array_equal(seen(BALL, seed=3), seen(BALL, seed=3))
    assert not np.array_equal(seen(BALL, seed=3), seen(BALL, seed=4))


def test_a_thin_object_is_looked_at_more_closely():
    rod = trimesh.creation.cylinder(radius=0.02, height=10, sections=16)
    points = seen(rod, 300, pixels=64)
    assert np.linalg.norm(points[:, :2], axis=1).max() < 0.021


def test_an_object_too_thin_to_see_is_named():
    wire = trimesh.creation.cylinder(radius=1e-5, height=10, sections=8)
    with pytest.raises(UserError, match=r"part-3: 1 cameras of 128 × 128 pixels see only \d+ of 512 points"):
        seen(wire, pixels=16)


def test_directions_keep_apart():
    directions = spread_directions(6, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    cosines = directions @ directions.T - 2 * np.eye(6)
    assert cosines.max() < np.cos(np.radians(40))
