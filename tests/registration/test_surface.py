"""Touched surfaces are height fields with tangent planes, which agree with formulas and with a search of all points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr.registration.surface import INSIDE, SLOPE, TouchedSurface, View
from tests.registration.patches import plate, wavy

TURN = Rotation.from_rotvec([0.5, -0.3, 1.0]).as_matrix()


def square(surface, half=4.0, count=600, seed=0):
    return surface(np.random.default_rng(seed).uniform(-half, half, (count, 2)))


def test_distances_from_a_tilted_plane_are_exact():
    axes = Rotation.from_rotvec([0.2, 0.1, 0]).as_matrix()
    surface = TouchedSurface.of(square(plate), axes, 3.0, oriented=True)
    points = np.random.default_rng(1).uniform(-4, 4, (200, 3)) * [1, 1, 0.3]
    distance, _ = surface.find(points)
    np.testing.assert_allclose(distance, points[:, 2], atol=1e-4)
    assert surface.noise < 1e-6
    assert surface.area == pytest.approx(64, rel=0.15)


def test_distances_from_a_sphere_are_those_from_its_surface():
    def ball(xy):
        return np.column_stack([xy, np.sqrt(400 - (xy**2).sum(1)) - 20])

    surface = TouchedSurface.of(square(ball, count=2000), np.eye(3), 3.0, oriented=True)
    rng = np.random.default_rng(1)
    points = square(ball, half=3.0, count=300, seed=2) + np.array([0, 0, 20])
    points *= 1 + rng.uniform(-0.02, 0.02, (300, 1))
    distance, outside = surface.find(points - [0, 0, 20])
    assert abs(distance - np.linalg.norm(points, axis=1) + 20).max() < 0.02
    assert (outside == 0).all()


def test_a_rigid_motion_of_points_and_axes_changes_nothing():
    points, queries = square(wavy), np.random.default_rng(1).uniform(-6, 6, (100, 3))
    here = TouchedSurface.of(points, np.eye(3), 3.0, oriented=True)
    there = TouchedSurface.of(points @ TURN.T + 5, TURN, 3.0, oriented=True)
    for one, other in zip(here.find(queries), there.find(queries @ TURN.T + 5), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert here.noise == pytest.approx(there.noise)


def test_the_planes_are_those_of_the_nearest_touched_points():
    points = square(wavy, count=300)
    surface = TouchedSurface.of(points, np.eye(3), 2.0, oriented=True)
    spacing = np.sqrt(np.prod(np.ptp(points[:, :2], axis=0)) / len(points))
    for at in np.random.default_rng(1).uniform(-5, 5, (50, 2)):
        x, y = at - surface.origin[:2]
        planes = surface.planes(np.array([x]), np.array([y]), np.array([0.0]))
        # The cell's centre is what counts: find it as the table does, but search all points.
        cell = (
            surface.corner + (np.floor((at - surface.origin[:2] - surface.corner) / surface.cell) + 0.5) * surface.cell
        )
        local = points - surface.origin
        away = np.linalg.norm(local[:, :2] - cell, axis=1)
        nearest = local[away.argmin()]
        around = local[np.argsort(np.linalg.norm(local[:, :2] - nearest[:2], axis=1))[:16]]
        design = np.column_stack([np.ones(16), around[:, :2] - nearest[:2]])
        constant, slope_x, slope_y = np.linalg.lstsq(design, around[:, 2], rcond=None)[0]
        height = -(constant + slope_x * (x - nearest[0]) + slope_y * (y - nearest[1]))
        assert planes.height[0] == pytest.approx(height, abs=1e-4)
        assert (planes.slope_x[0], planes.slope_y[0]) == pytest.approx((slope_x, slope_y), abs=1e-4)
        assert planes.flatness[0] == pytest.approx(1 / (1 + slope_x**2 + slope_y**2), abs=1e-4)
        outside = max(0.0, away.min() - INSIDE * spacing)
        assert planes.widening[0] == pytest.approx((SLOPE * outside) ** 2, rel=1e-6)
        assert planes.level[0] == (-np.inf if outside == 0 else np.inf)


def test_beyond_the_margin_there_is_no_surface():
    surface = TouchedSurface.of(square(plate), np.eye(3), 2.0, oriented=True)
    _, outside = surface.find(np.array([[0, 0, 1.0], [5, 0, 0], [50, 0, 0], [0, -7, 0]]))
    assert outside[0] == 0
    assert 0.2 < outside[1] < 1
    assert np.isinf(outside[2:]).all()


def test_beside_the_contact_the_sensor_saw_nothing_in_its_view():
    view = View(np.array([0, 0, -0.7]), (12.0, 9.0))
    surface = TouchedSurface.of(square(plate, half=3), np.eye(3), 6.0, oriented=True, view=view)
    x, y = np.array([0, 5, 0, 5, 8.0]), np.array([0, 0, 4.2, 5, 0])
    planes = surface.planes(x, y, np.zeros(5))
    np.testing.assert_array_equal(np.isfinite(planes.level), [False, True, True, False, False])
    np.testing.assert_array_equal(np.isfinite(planes.widening), [True, False, False, True, True])
    assert (planes.level[1:3] < 0).all()  # below the contact, since the gel was pressed in
    assert planes.level[0] == -np.inf


def test_of_very_many_points_some_count():
    points = square(wavy, count=30_000)
    surface = TouchedSurface.of(points, np.eye(3), 3.0, oriented=True)
    distance, _ = surface.find(points)
    assert np.sqrt((distance**2).mean()) < 0.01
