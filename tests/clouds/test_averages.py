"""Mean directions and quaternions: signs, faces and rotations."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.clouds.averages import mean_direction


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def angle(one, other):
    """Degrees between lines."""
    return np.degrees(np.arccos(np.abs((one * other).sum(-1)).clip(0, 1)))


@given(seed=st.integers(0, 1000), size=st.integers(2, 4))
def test_signs_change_nothing_but_the_sign(seed, size):
    rng = np.random.default_rng(seed)
    directions = unit(rng.normal(size=(8, size)))
    neighbours = np.array([rng.permutation(8)[:3] for _ in range(20)])
    weight = np.column_stack([np.ones(20), rng.random((20, 2))])
    signs = rng.choice([-1, 1], (8, 1))
    plain = mean_direction(directions, neighbours, weight)
    np.testing.assert_allclose(
        mean_direction(signs * directions, neighbours, weight), signs[neighbours[:, 0]] * plain, atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.norm(plain, axis=1), 1)


@given(seed=st.integers(0, 1000))
def test_the_mean_is_never_far_from_the_nearest(seed):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(9, 3))
    neighbours, weight = np.arange(9).reshape(3, 3), np.ones((3, 3))
    assert (angle(mean_direction(directions, neighbours, weight), unit(directions[[0, 3, 6]])) <= 60).all()


def test_the_other_face_of_an_edge_has_no_part_in_it():
    faces = np.array([[0.0, 0, 1], [0.8, 0, -0.6], [1, 0, 0]])
    made = mean_direction(faces, np.array([[0, 1], [0, 2], [2, 0]]), np.ones((3, 2)))
    angles = [angle(made[k], faces[near]) for k, near in enumerate((0, 0, 2))]
    assert angles[1:] == [0, 0]
    assert 0 < angles[0] < 60


def test_quaternions_average_to_the_rotation_between():
    rotations = Rotation.from_euler("z", [[10], [30]], degrees=True)
    quaternions = rotations.as_quat() * np.array([[1.0], [-7.0]])
    made = mean_direction(quaternions, np.array([[0, 1]]), np.ones((1, 2)))
    np.testing.assert_allclose(np.degrees(Rotation.from_quat(made).as_rotvec()), [[0, 0, 20]], atol=1e-9)


def test_a_nearest_without_a_length_is_given_as_it_is():
    directions = np.array([[0.0, 0, 0], [0, 0, 1], [np.nan, 0, 0]])
    made = mean_direction(directions, np.array([[0, 1], [2, 1], [1, 2]]), np.ones((3, 2)))
    np.testing.assert_array_equal(made, directions[[0, 2, 1]])
