"""What is found of a ball in exact slopes, and in slopes with errors."""

import numpy as np
import pytest

from pcsr.sensors.balls import ball_slopes, distance_to_ball, fitted_sphere, rim_radius, voted_centre

CENTRE, RADIUS = np.array([41.3, 28.7]), 30.0


def grid(h=60, w=80):
    rows, columns = np.mgrid[:h, :w].astype(float)
    return columns.ravel(), rows.ravel()


def pixels(within=0.8 * RADIUS):
    """The pixels within a distance of the ball's centre."""
    columns, rows = grid()
    near = np.hypot(columns - CENTRE[0], rows - CENTRE[1]) < within
    return columns[near], rows[near]


def height(columns, rows):
    return np.sqrt(RADIUS**2 - (columns - CENTRE[0]) ** 2 - (rows - CENTRE[1]) ** 2)


def test_slopes_are_the_differences_of_the_heights():
    columns, rows = pixels()
    step = 1e-5
    across = (height(columns + step, rows) - height(columns - step, rows)) / (2 * step)
    down = (height(columns, rows + step) - height(columns, rows - step)) / (2 * step)
    found = ball_slopes(columns, rows, CENTRE, RADIUS)
    np.testing.assert_allclose(found, np.stack([across, down], axis=-1), atol=1e-8)


def test_exact_slopes_vote_for_the_centre():
    columns, rows = pixels()
    found = voted_centre(columns, rows, ball_slopes(columns, rows, CENTRE, RADIUS), RADIUS)
    np.testing.assert_allclose(found, CENTRE, atol=1e-9)


def test_a_third_of_wrong_slopes_moves_the_centre_by_less_than_a_pixel():
    columns, rows = pixels()
    slopes = ball_slopes(columns, rows, CENTRE, RADIUS)
    slopes += np.random.default_rng(0).normal(0, 0.05, slopes.shape)
    wrong = np.random.default_rng(1).random(len(slopes)) < 1 / 3
    slopes[wrong] = np.random.default_rng(2).normal(0, 1, (wrong.sum(), 2))
    assert np.abs(voted_centre(columns, rows, slopes, RADIUS) - CENTRE).max() < 1


@pytest.mark.parametrize("rim", [12.0, 15.4, 18.5, 24.0])
def test_the_rim_is_where_the_slopes_are_steepest(rim):
    columns, rows = grid()
    distance = np.hypot(columns - CENTRE[0], rows - CENTRE[1])
    clipped = np.minimum(distance, rim)
    steep = clipped / np.sqrt(RADIUS**2 - clipped**2) * np.where(distance < rim, 1, np.exp((rim - distance) / 4))
    slopes = -steep[:, None] * np.stack([columns, rows], axis=-1) + steep[:, None] * CENTRE
    slopes /= np.maximum(distance, 1e-9)[:, None]
    assert rim_radius(columns, rows, slopes, CENTRE, RADIUS) == pytest.approx(rim, abs=1.0)


def test_the_rim_stays_within_its_bounds():
    columns, rows = grid()
    flat = np.zeros((len(columns), 2))
    everywhere = -np.stack([columns - CENTRE[0], rows - CENTRE[1]], axis=-1)
    assert 0.3 * RADIUS <= rim_radius(columns, rows, flat, CENTRE, RADIUS) <= 0.95 * RADIUS
    assert 0.9 * RADIUS <= rim_radius(columns, rows, everywhere, CENTRE, RADIUS) <= 0.95 * RADIUS
    assert rim_radius(columns, rows, everywhere, CENTRE, 4.0) <= 0.95 * 4


def test_a_sphere_through_exact_points_is_found():
    columns, rows = pixels(20.0)
    points = np.column_stack([columns, rows, height(columns, rows) - 7])
    centre, radius = fitted_sphere(points)
    np.testing.assert_allclose(centre, [*CENTRE, -7], atol=1e-5)
    assert radius == pytest.approx(RADIUS, abs=1e-5)


def test_the_sphere_is_of_least_squares():
    columns, rows = pixels(20.0)
    points = np.column_stack([columns, rows, height(columns, rows)])
    points[:, 2] += np.random.default_rng(0).normal(0, 0.3, len(points))
    centre, radius = fitted_sphere(points)

    def squares(centre, radius):
        return ((np.linalg.norm(points - centre, axis=1) - radius) ** 2).sum()

    least = squares(centre, radius)
    assert least < squares(np.array([*CENTRE, 0]), RADIUS)
    for step in (0.01, -0.01):
        assert squares(centre, radius + step) > least
        assert all(squares(centre + step * axis, radius) > least for axis in np.eye(3))


def test_distances_from_the_ball_are_positive_outside_of_it():
    columns, rows = pixels(20.0)
    points = np.column_stack([columns, rows, height(columns, rows) + 3])
    np.testing.assert_allclose(distance_to_ball(points, RADIUS), 0, atol=1e-6)
    dented = points.copy()
    highest = np.argmax(points[:, 2])
    dented[highest, 2] -= 2
    away = distance_to_ball(dented, RADIUS)
    assert away[highest] == pytest.approx(-2, abs=0.02)
    assert np.abs(np.delete(away, highest)).max() < 0.02
    # A larger ball touches the rim and the middle on different sides.
    larger = distance_to_ball(points, 1.2 * RADIUS)
    assert larger.min() < -0.05
    assert larger.max() > 0.05
