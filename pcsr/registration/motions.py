"""Small rigid motions as six numbers: a rotation vector, in radians, and a translation."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

Motions = Float[np.ndarray, "s 6"]


def moved_back(points: Float[np.ndarray, "n 3"], motions: Motions) -> Float[np.ndarray, "s n 3"]:
    """Apply the inverse of each motion to all points.

    Args:
        points: (n 3), in the frame of the motions.
        motions: (s 6); rotations are about the origin.
    """
    rotations = Rotation.from_rotvec(motions[:, :3]).as_matrix()
    back: Float[np.ndarray, "s n 3"] = (points - motions[:, None, 3:]) @ rotations
    return back


def moved(points: Float[np.ndarray, "n 3"], motion: Float[np.ndarray, "6"]) -> Float[np.ndarray, "n 3"]:
    """Apply a motion to points."""
    there: Float[np.ndarray, "n 3"] = points @ Rotation.from_rotvec(motion[:3]).as_matrix().T + motion[3:]
    return there


def matrix(motion: Float[np.ndarray, "6"]) -> Float[np.ndarray, "4 4"]:
    """Return the homogeneous matrix of a motion."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(motion[:3]).as_matrix()
    pose[:3, 3] = motion[3:]
    return pose


def carried(axes: Float[np.ndarray, "3 3"], origin: Float[np.ndarray, "3"]) -> Float[np.ndarray, "6 6"]:
    """Return the matrix that expresses small motions of one frame in another.

    Args:
        axes: axes of the other frame, as columns.
        origin: origin of the other frame.

    Returns:
        The adjoint: a small rotation about the first origin also translates the second.
    """
    x, y, z = origin
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = axes.T
    adjoint[3:, :3] = -axes.T @ cross
    return adjoint


def isotropic(position: float, rotation: float) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of motions with the same deviation along and about all axes.

    Args:
        position: standard deviation along each axis.
        rotation: standard deviation about each axis, in radians.
    """
    return np.diag(np.repeat([rotation**2, position**2], 3))
