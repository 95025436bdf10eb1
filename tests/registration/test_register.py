"""Touches with wrong poses come back onto the surface, and what the cloud doesn't constrain stays."""

from dataclasses import replace

import numpy as np
import pytest

from pcsr import PoseError, Touch, UserError, register
from tests.registration.patches import (
    CLOUD,
    EXACT,
    SIDES,
    by,
    left,
    plate,
    pressed,
    rigid,
    scaled,
    scan,
    wavy,
)

SHARED = rigid([1, -1, 0.5], [0.4, -0.5, 0.6])


def moved(cloud, matrix):
    return cloud @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.parametrize(("seed", "unit"), [(0, 1000.0), (1, 1.0)])
def test_a_rigid_motion_of_all_and_another_unit_change_nothing_else(seed, unit):
    rng = np.random.default_rng(seed)
    touches = [by(touch, rigid(rng.normal(size=3), rng.normal(size=3) * 0.7)) for touch in EXACT[:2]]
    touches.append(replace(touches[0], poses=touches[0].poses[:0]))
    frame = rigid(rng.uniform(-180, 180, 3), rng.uniform(-100, 100, 3))
    here = register(touches, CLOUD)
    there = register([scaled(by(touch, frame), unit) for touch in touches], moved(CLOUD, frame) / unit)
    for one, other in zip(here.touches, there.touches, strict=True):
        assert (one.verdict, one.reason, one.support) == (other.verdict, other.reason, other.support)
        np.testing.assert_allclose(moved(one.touch.points, frame), other.touch.points * unit, atol=1e-6)
        np.testing.assert_allclose(one.errors, other.errors * unit, atol=1e-6)
        np.testing.assert_allclose(frame @ one.motion @ np.linalg.inv(frame), in_unit(other.motion, unit), atol=1e-6)
        turn = np.kron(np.eye(2), frame[:3, :3])
        scale = np.repeat([1, unit], 3)
        np.testing.assert_allclose(turn @ one.covariance @ turn.T, other.covariance * np.outer(scale, scale), atol=1e-6)
    np.testing.assert_allclose(frame @ here.offset @ np.linalg.inv(frame), in_unit(there.offset, unit), atol=1e-6)
    assert here.shared_error == pytest.approx(there.shared_error)
    assert here.private_error == pytest.approx(there.private_error)


def in_unit(matrix, unit):
    matrix = matrix.copy()
    matrix[:3, 3] *= unit
    return matrix


@pytest.mark.parametrize("seed", range(3))
def test_a_touch_of_a_plate_comes_back_along_its_normal_and_slides_nowhere(seed):
    exact = pressed(plate, seed=seed + 10)
    touch = by(exact, rigid([1, 0.5, 0], [0.5, 0.3, 0.7]))
    one = register([touch], scan(plate, seed=seed)).touches[0]
    away = left((one, touch), exact)
    assert abs(away[:, 2]).max() < 0.05
    np.testing.assert_allclose(away[:, :2].mean(0), [0.5, 0.3], atol=0.15)
    assert one.verdict in ("moved", "partly")
    np.testing.assert_allclose(one.touch.poses[0], one.motion @ touch.poses[0])
    deviations = np.sqrt(np.diag(one.covariance))[3:]
    assert deviations[2] < 0.05 < 0.3 < deviations[0]


@pytest.mark.parametrize("seed", range(3))
def test_a_wavy_surface_corrects_the_slide_too(seed):
    exact = pressed(wavy, seed=seed + 10)
    touch = by(exact, rigid([1, 0, 0], [0.5, 0.3, 0.7]))
    one = register([touch], scan(wavy, seed=seed)).touches[0]
    assert np.linalg.norm(left((one, touch), exact), axis=1).mean() < 0.15
    assert one.verdict == "moved"


@pytest.mark.parametrize("view", [(16.0, 12.0), None])
@pytest.mark.parametrize("seed", range(2))
def test_an_edge_in_view_corrects_the_slide(seed, view):
    """The plate ends at x = 0, which the sensor sees; the pose is wrong towards the plate."""
    cloud = scan(plate, count=1800, seed=seed)
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, 3] = [-3, 0, -0.7]
    exact = Touch.single(plate(rng.uniform([-11, -6], [0, 6], (400, 2))), pose, 1.0, "digit", view=view)
    touch = by(exact, rigid([0, 0, 0], [-0.8, 0, 0.4]))
    one = register([touch], cloud[cloud[:, 0] < 0]).touches[0]
    slide = left((one, touch), exact)[:, 0].mean()
    if view:
        assert abs(slide) < 0.25
    else:
        assert slide == pytest.approx(-0.8, abs=0.2)


@pytest.mark.parametrize("error", [0.7, -0.7])
def test_a_touch_of_a_thin_plate_ends_on_its_own_side(error):
    """The sheets are 1.5 mm apart: 0.7 mm below the upper one it is as close to the lower one."""
    cloud = np.concatenate([scan(plate), scan(plate, seed=7) - [0, 0, 1.5]])
    exact = pressed(plate)
    one = register([touch := by(exact, rigid([0, 0, 0], [0.2, 0.1, error]))], cloud).touches[0]
    assert abs(left((one, touch), exact)[:, 2]).max() < 0.05


def test_without_a_pose_not_all_of_a_touch_of_a_thin_plate_is_used():
    cloud = np.concatenate([scan(plate), scan(plate, seed=7) - [0, 0, 1.5]])
    exact = pressed(plate)
    touch = by(replace(exact, poses=exact.poses[:0]), rigid([0, 0, 0], [0.2, 0.1, -0.7]))
    one = register([touch], cloud).touches[0]
    assert one.verdict in ("partly", "refused")


def test_one_arm_has_one_error():
    touches = [by(touch, SHARED) for touch in EXACT]
    found = register(touches, CLOUD)
    np.testing.assert_allclose(found.offset @ SHARED, np.eye(4), atol=0.1)
    corners = np.array([[20, 0, 0], [0, 20, 0], [0, 0, 20], [-20, 0, 0]])
    assert np.linalg.norm(moved(moved(corners, SHARED), found.offset) - corners, axis=1).max() < 0.15
    for one, touch, exact in zip(found.touches, touches, EXACT, strict=True):
        assert abs(left((one, touch), exact)).max() < 0.25
        assert one.verdict == "moved"
    assert found.private_error < 0.2 < found.shared_error


def test_a_touch_on_a_side_without_a_cloud_is_corrected_by_the_others():
    side = np.array(SIDES[3]) / np.linalg.norm(SIDES[3])
    seen = CLOUD[CLOUD @ side < 6]
    touches = [by(touch, SHARED) for touch in EXACT]
    one = register(touches, seen).touches[3]
    before = np.linalg.norm(touches[3].points - EXACT[3].points, axis=1).mean()
    after = np.linalg.norm(left((one, touches[3]), EXACT[3]), axis=1).mean()
    assert after < before / 3
    assert one.support == 0
    assert one.verdict == "moved"
    assert one.reason == "no point of the cloud lies on it, so that it cannot be checked"


def test_exact_touches_hardly_move():
    found = register(EXACT, CLOUD)
    for one, exact in zip(found.touches, EXACT, strict=True):
        assert np.linalg.norm(left((one, exact), exact), axis=1).max() < 0.1
        assert len(one.touch.points) == len(exact.points)
    assert found.shared_error < 0.1
    assert found.private_error < 0.1


def test_expected_errors_are_those_of_the_points():
    """Of points that are used the true error, from the surface, is about the expected one."""
    shares = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        cloud = scan(wavy, seed=seed)
        touch = by(pressed(wavy, seed=seed + 5), rigid(rng.normal(size=3), rng.normal(size=3) * 0.7))
        one = register([touch], cloud).touches[0]
        points = one.touch.points
        true = abs(points[:, 2] - wavy(points[:, :2])[:, 2])
        shares.append((true / one.errors < 2).mean())
    assert np.mean(shares) > 0.85


def test_exact_poses_keep_every_bit():
    touches = [by(touch, SHARED) for touch in EXACT]
    found = register(touches, CLOUD, pose_error=PoseError(0.0, 0.0))
    for one, touch in zip(found.touches, touches, strict=True):
        assert one.verdict == "kept"
        np.testing.assert_array_equal(one.touch.points, touch.points)
        np.testing.assert_array_equal(one.touch.poses, touch.poses)
        np.testing.assert_array_equal(one.motion, np.eye(4))
        np.testing.assert_array_equal(one.errors, np.zeros(len(touch.points)))
    np.testing.assert_array_equal(found.offset, np.eye(4))
    assert (found.shared_error, found.private_error) == (0, 0)


def test_the_same_touches_give_the_same_result():
    touches = [by(touch, SHARED) for touch in EXACT[:2]]
    one, other = register(touches, CLOUD), register(touches, CLOUD)
    for first, second in zip(one.touches, other.touches, strict=True):
        np.testing.assert_array_equal(first.touch.points, second.touch.points)
    np.testing.assert_array_equal(one.offset, other.offset)


def test_no_touches_are_no_error():
    found = register([], CLOUD)
    assert found.touches == []
    np.testing.assert_array_equal(found.offset, np.eye(4))


def test_what_cannot_be_registered_is_said():
    bad = EXACT[1].points.copy()
    bad[3, 1] = np.nan
    with pytest.raises(UserError, match=r"touch 1 has 400 points, which must be some and finite"):
        register([EXACT[0], replace(EXACT[1], points=bad)], CLOUD)
    with pytest.raises(UserError, match=r"touch 0 has 0 points"):
        register([replace(EXACT[0], points=np.zeros((0, 3)), finger=np.zeros(0, int))], CLOUD)
    with pytest.raises(UserError, match=r"the cloud holds no points"):
        register(EXACT, np.zeros((0, 3)))
    with pytest.raises(UserError, match=r"the cloud: 1 of 2 points have a coordinate that is not finite"):
        register(EXACT, np.array([[0, 0, 0], [0, np.inf, 0]]))
    with pytest.raises(UserError, match=r"need the same unit, got \[1.0, 1000.0\] mm"):
        register([EXACT[0], scaled(EXACT[1], 1000.0)], CLOUD)


def test_the_sensors_errors_add_to_those_of_the_registration():
    touch = pressed(wavy)
    plain = register([touch], scan(wavy)).touches[0]
    errors = np.linspace(0.1, 0.5, len(touch.points))
    found = register([replace(touch, errors=errors)], scan(wavy)).touches[0]
    own = found.touch.errors
    assert len(own) == len(found.errors)
    assert (found.errors >= own).all()
    assert np.median(found.errors) > 2 * np.median(plain.errors)
    exact = register([replace(touch, errors=errors)], scan(wavy), pose_error=PoseError(position=0.0, rotation=0.0))
    np.testing.assert_array_equal(exact.touches[0].errors, errors)
    same = register([replace(touch, errors=np.zeros(len(touch.points)))], scan(wavy)).touches[0]
    np.testing.assert_array_equal(same.touch.points, plain.touch.points)


@pytest.mark.parametrize("errors", [np.full(400, np.nan), np.full(400, -1.0)])
def test_errors_that_are_none_are_refused(errors):
    with pytest.raises(UserError, match="touch 0: errors must be 400 numbers"):
        register([replace(pressed(wavy), errors=errors)], scan(wavy))
