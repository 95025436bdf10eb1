import numpy as np
import pytest

from pcsr.exploration.contact import ContactModel
from pcsr.exploration.guess import direction, guessed_candidates, hidden_surface
from pcsr.exploration.reach import reachable
from pcsr.exploration.surface import KnownSurface
from tests.exploration.scenes import NOTHING, TIP, ball, plane, upper

UP = np.array([0.0, 0, 1])


def rng():
    return np.random.default_rng(3)


def test_the_hidden_side_is_guessed_where_it_is():
    points, normals, areas = hidden_surface(KnownSurface.of(upper(ball(800)), NOTHING), UP)
    assert len(points) > 50
    assert (points[:, 2] < 0).all()
    assert (normals[:, 2] < 0).all()
    assert 100 < areas.sum() < 2 * np.pi * 15**2


def test_a_whole_ball_and_a_plane_hide_nothing():
    for cloud, towards in ((ball(800), None), (plane(), None), (plane(), UP)):
        points, normals, areas = hidden_surface(KnownSurface.of(cloud, NOTHING), towards)
        assert points.shape == normals.shape == (0, 3)
        assert areas.shape == (0,)
    candidates, guessed = guessed_candidates(KnownSurface.of(ball(800), NOTHING), None, 50, TIP, rng())
    assert len(candidates) == 50
    assert not guessed.any()


def test_candidates_stand_outside_along_the_normals():
    candidates, guessed = guessed_candidates(KnownSurface.of(upper(ball(800)), NOTHING), UP, 100, TIP, rng())
    assert len(candidates) == 100
    assert guessed.any()
    axes = candidates.frames[~guessed][:, :, 2]
    outwards = candidates.points[~guessed] / 15
    assert (np.einsum("ij,ij->i", axes, outwards) > 0.5).mean() > 0.95
    np.testing.assert_allclose(np.linalg.det(candidates.frames), 1, atol=1e-9)


def test_the_surface_is_drawn_between_known_points():
    known = KnownSurface.of(ball(800), NOTHING)
    candidates, _ = guessed_candidates(known, None, 200, TIP, rng())
    assert candidates.surface.shape == (512, 3)
    radii = np.linalg.norm(candidates.surface, axis=1)
    assert (radii > 13.5).all()
    assert (radii <= 15 + 1e-9).all()
    assert known.tree.query(candidates.surface)[0].min() > 0
    octants = np.unique((candidates.surface > 0) @ [1, 2, 4], return_counts=True)[1]
    assert octants.min() > 10


def test_the_far_side_of_a_scene_is_not_guessed():
    for size, some in ((1.0, True), (20.0, False)):
        known = KnownSurface.of(size * upper(ball(800), above=1.0), NOTHING)
        assert (direction(known, None, TIP) is not None) == some
        assert (direction(known, UP, TIP) is not None) == some


def test_in_a_narrow_shaft_there_is_no_room_for_the_housing():
    floor, walls = plane(300, side=20), []
    for axis in (0, 1):
        for side in (-10.0, 10.0):
            wall = plane(600, side=20)
            upright = np.zeros((600, 3))
            upright[:, axis], upright[:, 1 - axis], upright[:, 2] = side, wall[:, 0], wall[:, 1] + 10
            walls.append(upright)
    model = ContactModel.of(np.concatenate([floor, *walls]))
    candidates, _ = guessed_candidates(KnownSurface.of(floor, NOTHING), None, 20, TIP, rng())
    middle = type(candidates)(np.zeros((1, 3)), np.eye(3)[None], np.ones(1), TIP)
    assert reachable(middle, model).refused == {"without room for the housing": 1}
    assert len(reachable(middle, ContactModel.of(floor)).rows) == 1


@pytest.mark.parametrize("at", [(500.0, 0, 0), (0, 0, -20.0)])
def test_poses_beside_or_behind_the_cloud_are_refused(at):
    candidates, _ = guessed_candidates(KnownSurface.of(plane(), NOTHING), None, 1, TIP, rng())
    away = type(candidates)(np.array([at]), np.eye(3)[None], np.ones(1), TIP)
    assert reachable(away, ContactModel.of(plane())).refused == {"behind other points of the cloud": 1}
