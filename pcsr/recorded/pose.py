"""Poses as people record them, as pcsr has them: from mm in the sensor's frame to the object's frame and unit."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pcsr.errors import UserError
from pcsr.recorded.manifest import Axis, EulerPose, MatrixPose, QuaternionPose

TOLERANCE = 1e-3
"""How far a rotation may be off, in each of its nine numbers and in scale."""

AnyPose = MatrixPose | QuaternionPose | EulerPose


def rotation_from(axes: Axis) -> Float[np.ndarray, "4 4"]:
    """From pcsr's sensor frame, which looks along -z, to one of the same origin that looks along `axes`.

    The shortest rotation there is; to +z it is half a turn about x, so that an image's right stays right.
    """
    matrix = np.eye(4)
    ours = np.array([0.0, 0.0, -1.0])
    theirs = np.zeros(3)
    theirs["xyz".index(axes[1])] = 1.0 if axes[0] == "+" else -1.0
    if axes == "+z":
        matrix[:3, :3] = np.diag([1.0, -1.0, -1.0])
    elif axes != "-z":
        about = np.cross(ours, theirs)
        matrix[:3, :3] = np.outer(about, about) + np.outer(theirs, ours) - np.outer(ours, theirs)
    return matrix


def transformed(pose: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Points through a pose."""
    moved: Float[np.ndarray, "n 3"] = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def offset_z(distance: float) -> Float[np.ndarray, "4 4"]:
    """The pose of a frame whose origin lies at z = `distance`."""
    matrix = np.eye(4)
    matrix[2, 3] = distance
    return matrix


def in_object(rigid: Float[np.ndarray, "4 4"], unit: float, object_unit: float) -> Float[np.ndarray, "4 4"]:
    """A rigid pose, with its translation in `unit`, as one from mm to the object's unit; units in mm."""
    pose = rigid.copy()
    pose[:3, :3] /= object_unit
    pose[:3, 3] *= unit / object_unit
    return pose


def sensor_to_object(
    pose: AnyPose, unit: float, object_unit: float, object_pose: AnyPose | None = None
) -> Float[np.ndarray, "4 4"]:
    """A recorded pose as one from mm in the recording's own sensor frame to the object's frame and unit.

    Args:
        pose: as recorded.
        unit: of translations, and of the coordinates that a matrix maps, in mm.
        object_unit: of the object's frame, in mm.
        object_pose: the object's own in the world, where `pose` leads to the world.

    Raises:
        UserError: it is no pose, or its scale contradicts the units.
    """
    if isinstance(pose, MatrixPose) and pose.maps_to != "rigid" and object_pose is None:
        matrix = check_matrix(np.array(pose.matrix, np.float64), unit / object_unit)
        matrix[:3, :3] /= unit
        return matrix
    matrix = rigid(pose, in_world=object_pose is not None)
    if object_pose is not None:
        matrix = np.linalg.inv(rigid(object_pose, "object_pose", in_world=True)) @ matrix
    return in_object(matrix, unit, object_unit)


def rigid(pose: AnyPose, name: str = "pose", *, in_world: bool = False) -> Float[np.ndarray, "4 4"]:
    """A rotation and a translation, as a matrix.

    Raises:
        UserError: it is none.
    """
    if isinstance(pose, MatrixPose):
        if pose.maps_to != "rigid" and not (in_world and pose.maps_to is None):
            raise UserError(f'{name}.maps_to: this pose cannot change the unit: say "maps_to": "rigid"')
        return check_matrix(np.array(pose.matrix, np.float64), 1.0, f"{name}.matrix")
    matrix = np.eye(4)
    matrix[:3, :3] = _quaternion(pose, name) if isinstance(pose, QuaternionPose) else _euler(pose, name)
    matrix[:3, 3] = pose.translation
    return matrix


def pose_from_7_vector(row: Float[np.ndarray, "7"], name: str) -> Float[np.ndarray, "4 4"]:
    """A rigid pose from x, y, z, qx, qy, qz, qw.

    Raises:
        UserError: it is not finite, or its quaternion is none.
    """
    if not np.isfinite(row).all():
        raise UserError(f"{name} is not finite: {row.tolist()}")
    pose = QuaternionPose(translation=row[:3].tolist(), quaternion=row[3:].tolist(), order="xyzw")
    return rigid(pose, name)


def check_matrix(matrix: Float[np.ndarray, "4 4"], scale: float, name: str = "pose.matrix") -> Float[np.ndarray, "4 4"]:
    """The matrix itself, if it is a rotation times `scale`, and a translation.

    Raises:
        UserError: it is not finite, its last row is another, it mirrors, or it stretches otherwise.
    """
    if not np.isfinite(matrix).all():
        raise UserError(f"{name} is not finite: {matrix.tolist()}")
    if matrix[3].tolist() != [0, 0, 0, 1]:
        raise UserError(f"{name}: its last row is {matrix[3].tolist()}, not 0 0 0 1: is it transposed?")
    with np.errstate(all="ignore"):
        volume = float(np.linalg.det(matrix[:3, :3]))
    if volume < 0:
        raise UserError(f"{name} mirrors: its determinant is {volume:.4g}; a sensor cannot be turned inside out")
    found = volume ** (1 / 3)
    if not abs(found / scale - 1) <= TOLERANCE:  # nor may it be nan
        raise UserError(
            f"{name} scales by {found:.6g}, and with these units it should by {scale:.6g}: set unit and "
            f'object_unit right, or say "maps_to": "rigid" if its translation is in `unit` as the clouds are'
        )
    rotation = matrix[:3, :3] / scale
    with np.errstate(all="ignore"):
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not off <= 2 * TOLERANCE:
        raise UserError(f"{name} is no rotation: R Rᵀ is off from the unit matrix by {off:.3g}")
    return matrix


def _quaternion(pose: QuaternionPose, name: str) -> Float[np.ndarray, "3 3"]:
    quaternion = np.array(pose.quaternion)
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1) > TOLERANCE:
        raise UserError(f"{name}.quaternion: its norm is {norm:.6g}, not 1: {pose.quaternion} is no rotation")
    xyzw = quaternion if pose.order == "xyzw" else np.roll(quaternion, -1)
    matrix: Float[np.ndarray, "3 3"] = Rotation.from_quat(xyzw).as_matrix()
    return matrix


def _euler(pose: EulerPose, name: str) -> Float[np.ndarray, "3 3"]:
    if len(pose.axes) != len(pose.euler):
        raise UserError(f"{name}.euler: {len(pose.euler)} angles about the axes '{pose.axes}': give one for each")
    try:
        rotation = Rotation.from_euler(pose.axes, pose.euler, degrees=pose.angle == "degrees")
    except ValueError as error:
        raise UserError(f"{name}.axes: '{pose.axes}': {error}") from error
    matrix: Float[np.ndarray, "3 3"] = rotation.as_matrix()
    return matrix.reshape(3, 3)
