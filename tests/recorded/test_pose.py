import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.recorded.pose import (
    in_object,
    offset_z,
    pose_from_7_vector,
    rigid,
    rotation_from,
    sensor_to_object,
    transformed,
)
from pcsr.recorded.pose_models import EulerPose, MatrixPose, QuaternionPose

AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}
LENGTHS = st.sampled_from([1000.0, 10.0, 1.0, 0.001, 25.4, 500.0])


def matrix(rotation, place, scale=1.0):
    whole = np.eye(4)
    whole[:3, :3] = scale * rotation.as_matrix()
    whole[:3, 3] = place
    return whole


@pytest.mark.parametrize(("axes", "direction"), AXES.items())
def test_a_turn_takes_our_view_to_theirs_and_mirrors_nothing(axes, direction):
    turned = rotation_from(axes)
    assert (turned[:3, :3] @ [0, 0, -1]).tolist() == list(direction)
    np.testing.assert_array_equal(turned[:3, :3] @ turned[:3, :3].T, np.eye(3))
    assert np.linalg.det(turned) == pytest.approx(1)
    assert turned[:, 3].tolist() == [0, 0, 0, 1]
    angle = np.degrees(Rotation.from_matrix(turned[:3, :3]).magnitude())
    assert angle == pytest.approx({"-z": 0, "+z": 180}.get(axes, 90))  # the shortest there is
    if axes == "+z":
        assert (turned[:3, :3] @ [1, 0, 0]).tolist() == [1, 0, 0]


@given(unit=LENGTHS, object_unit=LENGTHS, seed=st.integers(0, 1000))
def test_all_ways_to_write_a_pose_say_the_same(unit, object_unit, seed):
    rng = np.random.default_rng(seed)
    rotation, place = Rotation.random(rng=rng), rng.normal(size=3)
    xyzw, euler, fixed = rotation.as_quat(), rotation.as_euler("XYZ", degrees=True), rotation.as_euler("zyx")
    poses = [
        QuaternionPose(translation=place.tolist(), quaternion=xyzw.tolist(), order="xyzw"),
        QuaternionPose(translation=place.tolist(), quaternion=(-xyzw[[3, 0, 1, 2]]).tolist(), order="wxyz"),
        EulerPose(translation=place.tolist(), euler=euler.tolist(), axes="XYZ", angle="degrees"),
        EulerPose(translation=place.tolist(), euler=fixed.tolist(), axes="zyx", angle="radians"),
        MatrixPose(matrix=matrix(rotation, place).tolist(), maps_to="rigid"),
        MatrixPose(matrix=matrix(rotation, place * unit / object_unit, unit / object_unit).tolist()),
        MatrixPose(
            matrix=matrix(rotation, place * unit / object_unit, unit / object_unit).tolist(), maps_to="object_unit"
        ),
    ]
    local = rng.normal(size=3)  # in mm, in the sensor's frame
    truth = (rotation.apply(local) + place * unit) / object_unit
    for pose in poses:
        found = sensor_to_object(pose, unit, object_unit)
        np.testing.assert_allclose(transformed(found, local[None])[0], truth, rtol=1e-9, atol=1e-12 / object_unit)


@given(unit=LENGTHS, object_unit=LENGTHS, seed=st.integers(0, 1000))
def test_poses_in_the_world_lead_to_the_object(unit, object_unit, seed):
    rng = np.random.default_rng(seed)
    sensor, thing = (matrix(Rotation.random(rng=rng), rng.normal(size=3)) for _ in range(2))
    local = np.array([*rng.normal(size=3), unit]) / unit
    truth = (np.linalg.inv(thing) @ sensor @ local)[:3] * unit / object_unit
    for maps_to in ("rigid", None):
        poses = [MatrixPose(matrix=pose.tolist(), maps_to=maps_to) for pose in (sensor, thing)]
        found = sensor_to_object(poses[0], unit, object_unit, poses[1])
        np.testing.assert_allclose(transformed(found, local[None, :3] * unit)[0], truth, rtol=1e-9, atol=1e-9)


def test_small_and_capital_axes_are_fixed_and_moving():
    def pose(axes):
        return EulerPose(translation=[0, 0, 0], euler=[90, 90], axes=axes, angle="degrees")

    # About x and then about the fixed z: y goes up to z, and stays there.
    np.testing.assert_allclose(rigid(pose("xz"))[:3, :3] @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(rigid(pose("XZ"))[:3, :3] @ [0, 1, 0], [-1, 0, 0], atol=1e-12)


def test_a_matrix_is_kept_to_the_last_bit():
    whole = matrix(Rotation.from_euler("xyz", [1, 2, 3]), [1 / 3, -0.0, 1e-300], 1 / 3.7)
    found = sensor_to_object(MatrixPose(matrix=whole.tolist(), maps_to="object_unit"), 1.0, 3.7)
    assert found.tobytes() == whole.tobytes()


def test_in_object_and_moved_along_z_are_what_they_say():
    pose = in_object(matrix(Rotation.identity(), [1, 2, 3]), 1000.0, 500.0) @ offset_z(-22.0)
    assert transformed(pose, np.array([[500.0, 0, 22]])).tolist() == [[3, 4, 6]]


GOOD = np.eye(4)


def changed(row, column, value):
    whole = GOOD.copy()
    whole[row, column] = value
    return whole


@pytest.mark.parametrize(
    ("whole", "reason"),
    [
        (changed(3, 0, 1e-9), "its last row is .*, not 0 0 0 1: is it transposed"),
        (changed(3, 3, 2), "its last row is"),
        (changed(0, 0, -1), "mirrors: its determinant is -1"),
        (changed(0, 0, 0), "scales by 0, .* require 1"),
        (changed(0, 1, 0.01), "is no rotation"),
        (GOOD * [[10], [10], [10], [1]], "scales by 10, but these units require 1: correct unit and object_unit"),
        (np.diag([1e200, 1e200, 1e200, 1]), "scales by inf"),
        (np.diag([2, 1, 0.5, 1]), "is no rotation"),
        (np.diag([1e-200, 1e200, 1, 1]), "is no rotation"),
    ],
)
@pytest.mark.parametrize("maps_to", ["object_unit", "rigid"])
def test_a_matrix_that_is_no_pose_is_refused(whole, reason, maps_to):
    with pytest.raises(UserError, match=r"pose\.matrix:? .*" + reason):
        sensor_to_object(MatrixPose(matrix=whole.tolist(), maps_to=maps_to), 1.0, 1.0)


def test_rounded_rotations_pass():
    rounded = np.round(matrix(Rotation.from_euler("xyz", [1, 2, 3]), [1, 2, 3]), 4)
    sensor_to_object(MatrixPose(matrix=rounded.tolist(), maps_to="rigid"), 1.0, 1.0)
    pose_from_7_vector(np.round([1, 2, 3, *Rotation.from_euler("xyz", [1, 2, 3]).as_quat()], 4), "pose")


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (QuaternionPose(translation=[0, 0, 0], quaternion=[0, 0, 0, 0], order="xyzw"), "quaternion: its norm is 0"),
        (QuaternionPose(translation=[0, 0, 0], quaternion=[0, 0, 0, 1.1], order="xyzw"), "its norm is 1.1, not 1"),
        (EulerPose(translation=[0, 0, 0], euler=[1, 2], axes="xyz", angle="degrees"), "2 angles about the axes 'xyz'"),
        (EulerPose(translation=[0, 0, 0], euler=[1, 2, 3], axes="xxz", angle="degrees"), "pose.axes: 'xxz'"),
    ],
)
def test_rotations_that_are_none_are_refused(pose, reason):
    with pytest.raises(UserError, match=reason):
        sensor_to_object(pose, 1.0, 1.0)


def test_a_pose_to_the_world_cannot_end_in_the_objects_unit():
    pose = MatrixPose(matrix=GOOD.tolist(), maps_to="object_unit")
    fine = MatrixPose(matrix=GOOD.tolist())
    with pytest.raises(UserError, match=r"pose\.maps_to: this pose cannot change the unit"):
        sensor_to_object(pose, 1.0, 1.0, fine)
    with pytest.raises(UserError, match=r"object_pose\.maps_to: this pose cannot change the unit"):
        sensor_to_object(fine, 1.0, 1.0, pose)


def test_seven_numbers_are_a_place_and_a_quaternion_whose_w_is_last():
    pose = pose_from_7_vector(np.array([1, 2, 3, 0, 0, np.sqrt(0.5), np.sqrt(0.5)]), "pose")
    np.testing.assert_allclose(transformed(pose, np.array([[1.0, 0, 0]])), [[1, 3, 3]])
    with pytest.raises(UserError, match="camposes is not finite"):
        pose_from_7_vector(np.array([np.nan, 2, 3, 0, 0, 0, 1]), "camposes")
    with pytest.raises(UserError, match=r"camposes\.quaternion: its norm is 2"):
        pose_from_7_vector(np.array([0.0, 2, 3, 0, 0, 0, 2]), "camposes")
