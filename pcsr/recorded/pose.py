"""Conversion of recorded poses to pcsr's: from mm in the sensor's frame to the object's frame and unit."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pcsr.errors import UserError
from pcsr.recorded.fields import Axis
from pcsr.recorded.pose_models import EulerPose, MatrixPose, QuaternionPose

TOLERANCE = 1e-3
"""Largest relative error of a rotation's scale. Entries of R Rᵀ - I may be up to twice as large."""

AnyPose = MatrixPose | QuaternionPose | EulerPose


def rotation_from(axes: Axis) -> Float[np.ndarray, "4 4"]:
    """Return the rotation from pcsr's sensor frame, which looks along -z, to a frame that looks along `axes`.

    It is the shortest such rotation about the common origin. For `+z` it is half a turn about x, so that x, the right
    of an image, keeps its direction.
    """
    matrix = np.eye(4)
    source = np.array([0.0, 0.0, -1.0])
    target = np.zeros(3)
    target["xyz".index(axes[1])] = 1.0 if axes[0] == "+" else -1.0
    if axes == "+z":
        matrix[:3, :3] = np.diag([1.0, -1.0, -1.0])
    elif axes != "-z":
        axis = np.cross(source, target)
        matrix[:3, :3] = np.outer(axis, axis) + np.outer(target, source) - np.outer(source, target)
    return matrix


def transformed(pose: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Transform points with a pose."""
    moved: Float[np.ndarray, "n 3"] = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def offset_z(distance: float) -> Float[np.ndarray, "4 4"]:
    """Return the pose of a frame whose origin lies at z = `distance`."""
    matrix = np.eye(4)
    matrix[2, 3] = distance
    return matrix


def in_object(rigid: Float[np.ndarray, "4 4"], unit: float, object_unit: float) -> Float[np.ndarray, "4 4"]:
    """Convert a rigid pose, with its translation in `unit`, to one from mm to the object's unit; units are in mm."""
    pose = rigid.copy()
    pose[:3, :3] /= object_unit
    pose[:3, 3] *= unit / object_unit
    return pose


def sensor_to_object(
    pose: AnyPose, unit: float, object_unit: float, object_pose: AnyPose | None = None
) -> Float[np.ndarray, "4 4"]:
    """Convert a recorded pose to one from mm in the recording's sensor frame to the object's frame and unit.

    Args:
        pose: recorded pose, to the object or to the world.
        unit: unit of translations, and of the coordinates that a matrix maps, in mm.
        object_unit: unit of the object's frame, in mm.
        object_pose: pose of the object in the world, if `pose` leads to the world.

    Raises:
        UserError: the matrix or the rotation is invalid, or its scale contradicts the units.
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
    """Return the matrix of a rigid pose.

    Args:
        pose: recorded pose.
        name: name of the pose, for messages.
        in_world: the pose leads to the world, where matrices are rigid by default.

    Raises:
        UserError: the rotation is invalid, or the pose changes the unit.
    """
    if isinstance(pose, MatrixPose):
        if pose.maps_to != "rigid" and not (in_world and pose.maps_to is None):
            raise UserError(f'{name}.maps_to: this pose cannot change the unit: set "maps_to": "rigid"')
        return check_matrix(np.array(pose.matrix, np.float64), 1.0, f"{name}.matrix")
    matrix = np.eye(4)
    matrix[:3, :3] = _quaternion(pose, name) if isinstance(pose, QuaternionPose) else _euler(pose, name)
    matrix[:3, 3] = pose.translation
    return matrix


def pose_from_7_vector(row: Float[np.ndarray, "7"], name: str) -> Float[np.ndarray, "4 4"]:
    """Return the matrix of a rigid pose from x, y, z, qx, qy, qz, qw.

    Raises:
        UserError: a number is not finite, or the quaternion does not have norm 1.
    """
    if not np.isfinite(row).all():
        raise UserError(f"{name} is not finite: {row.tolist()}")
    pose = QuaternionPose(translation=row[:3].tolist(), quaternion=row[3:].tolist(), order="xyzw")
    return rigid(pose, name)


def check_matrix(matrix: Float[np.ndarray, "4 4"], scale: float, name: str = "pose.matrix") -> Float[np.ndarray, "4 4"]:
    """Check that a matrix is a rotation times `scale` with a translation, and return it.

    Args:
        matrix: homogeneous matrix.
        scale: expected scale.
        name: name of the matrix, for messages.

    Raises:
        UserError: a number is not finite, the last row is not 0 0 0 1, or the matrix mirrors, shears or has another
            scale.
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
            f"{name} scales by {found:.6g}, but these units require {scale:.6g}: correct unit and "
            f'object_unit, or set "maps_to": "rigid" if its translation is in `unit`, like the clouds'
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
