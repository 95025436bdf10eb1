"""Touches and clouds of surfaces that are given by formulas. Lengths are in millimetres."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pcsr import Touch


def plate(xy):
    return np.column_stack([xy, np.zeros(len(xy))])


def wavy(xy):
    x, y = xy.T
    return np.column_stack([xy, 0.6 * np.sin(0.7 * x) + 0.5 * np.cos(0.6 * y + 0.2 * x)])


def step(xy):
    return np.column_stack([xy, np.where(xy[:, 0] > 0, -8.0, 0.0)])


def scan(surface, count=900, half=25.0, seed=0):
    """Points of a surface over a square."""
    return surface(np.random.default_rng(seed).uniform(-half, half, (count, 2)))


def pressed(surface, at=(0.0, 0.0), half=4.0, count=400, seed=1, view=None):
    """Touch from above of a square of a surface."""
    points = surface(np.array(at) + np.random.default_rng(seed).uniform(-half, half, (count, 2)))
    pose = np.eye(4)
    pose[:3, 3] = [*at, points[:, 2].max() - 0.7]
    return Touch.single(points, pose, 1.0, "digit", view=view)


def bumpy(directions):
    """Sphere of radius 20 with bumps, which fix all six numbers of a motion."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = 6 * directions.T
    return directions * (20 + np.sin(x + 1) * np.cos(y) + np.sin(1.3 * z + y))[:, None]


def bumpy_scan(count=900, seed=0):
    return bumpy(np.random.default_rng(seed).normal(size=(count, 3)))


def bumpy_touch(towards, half=5.0, count=400, seed=1):
    """Touch of the bumpy sphere from outside, at the place where it faces `towards`."""
    z = np.array(towards, float) / np.linalg.norm(towards)
    x = np.cross(z, [0.3, 0.5, 0.8])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    uv = np.random.default_rng(seed).uniform(-half, half, (count, 2))
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, y, z])
    pose[:3, 3] = 19 * z
    return Touch.single(bumpy(19 * z + uv @ np.stack([x, y])), pose, 1.0, "digit")


SIDES = [(1, 0.2, 0.1), (-0.7, 0.6, 0.2), (0.1, -1, 0.5), (-0.1, 0.2, -1)]
"""Directions of touches on different sides."""


def rigid(degrees, millimetres):
    """Homogeneous matrix of a rotation vector and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(degrees, degrees=True).as_matrix()
    matrix[:3, 3] = millimetres
    return matrix


def by(touch, matrix):
    """Touch that is moved by a rigid motion."""
    points = touch.points @ matrix[:3, :3].T + matrix[:3, 3]
    return replace(touch, points=points, poses=matrix @ touch.poses if len(touch.poses) else touch.poses)


def scaled(touch, unit):
    """The same touch in another unit."""
    poses = touch.poses.copy()
    poses[:, :3] /= unit
    return replace(touch, points=touch.points / unit, poses=poses, unit=unit)


def left(registered, exact):
    """Vectors from the exact points to the registered ones, of all points, in the unit of the touch."""
    one, true = registered
    return true.points @ one.motion[:3, :3].T + one.motion[:3, 3] - exact.points


EXACT = [bumpy_touch(side) for side in SIDES]
"""Exact touches of the bumpy sphere."""
CLOUD = bumpy_scan()
"""Cloud of the bumpy sphere."""
