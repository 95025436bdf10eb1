"""Motions agree with loops over homogeneous matrices."""

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from pcsr.registration.motions import carried, isotropic, matrix, moved, moved_back

RNG = np.random.default_rng(0)
MOTIONS = RNG.normal(size=(5, 6)) * [0.3, 0.3, 0.3, 2, 2, 2]
POINTS = RNG.normal(size=(7, 3))


def applied(pose, point):
    return (pose @ np.append(point, 1))[:3]


def test_a_motion_turns_about_the_origin_and_then_translates():
    for motion in MOTIONS:
        x, y, z = motion[:3]
        pose = matrix(motion)
        np.testing.assert_allclose(pose[:3, :3], expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])), atol=1e-12)
        np.testing.assert_array_equal(pose[:3, 3], motion[3:])
        np.testing.assert_allclose(moved(POINTS, motion), [applied(pose, point) for point in POINTS])


def test_moving_back_is_the_inverse():
    back = moved_back(POINTS, MOTIONS)
    for motion, each in zip(MOTIONS, back, strict=True):
        np.testing.assert_allclose(each, [applied(np.linalg.inv(matrix(motion)), point) for point in POINTS])


def test_a_small_motion_is_the_same_in_another_frame():
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_rotvec([0.4, -1, 2]).as_matrix()
    frame[:3, 3] = [3, -2, 1]
    for motion in MOTIONS * 1e-5:
        there = np.linalg.inv(frame) @ matrix(motion) @ frame
        np.testing.assert_allclose(matrix(carried(frame[:3, :3], frame[:3, 3]) @ motion), there, atol=1e-9)


def test_isotropic_deviations_are_squared():
    np.testing.assert_array_equal(isotropic(2.0, 0.5), np.diag([0.25, 0.25, 0.25, 4, 4, 4]))
