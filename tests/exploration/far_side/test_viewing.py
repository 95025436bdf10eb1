import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr.exploration.far_side.viewing import seen_from, visible
from tests.exploration.scenes import ball, plane

TURNS = Rotation.random(4, random_state=0).as_matrix()


@pytest.mark.parametrize("turn", range(len(TURNS)))
def test_what_a_camera_sees_of_a_ball_was_seen_from_above_it(turn):
    half = ball(800)
    half = half[half[:, 2] > 5] @ TURNS[turn].T + 100  # a camera three radii away sees so much
    towards = seen_from(half)
    assert towards is not None
    assert np.linalg.norm(towards) == pytest.approx(1)
    assert towards @ TURNS[turn][:, 2] > np.cos(np.radians(15))


def test_what_was_seen_from_all_sides_has_no_direction():
    assert seen_from(ball(800)) is None
    assert seen_from(ball(20_000)) is None


def test_many_points_have_the_direction_of_few():
    many = ball(40_000)
    towards = seen_from(many[many[:, 2] > 0])
    assert towards is not None
    assert towards[2] > 0.95


def test_the_near_half_of_a_ball_is_visible():
    points = ball(2000)
    seen = visible(points, np.array([0.0, 0, 1]))
    assert (points[seen][:, 2] > -2).all()
    assert seen[points[:, 2] > 7].mean() > 0.9


def test_a_sheet_has_no_side():
    assert seen_from(plane(400)) is None
