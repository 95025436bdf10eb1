"""Registrations that are made by hand, of touches on a bowl in millimetres."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from pcsr import RegisteredTouch, Registration, Touch

NAMES = ["front", "left", "[red]below"]


def bowl(xy):
    return np.column_stack([xy, 0.003 * xy[:, 0] ** 2 + 0.001 * xy[:, 1] ** 2])


def scan(count=3000, seed=0):
    return bowl(np.random.default_rng(seed).uniform(-50, 50, (count, 2)))


def touches(unit=1.0):
    """Three touches of 60 points on the bowl, in the given unit."""
    rng = np.random.default_rng(1)
    patches = [bowl(rng.uniform(-5, 5, (60, 2)) + at) for at in [(0, 0), (20, 5), (-30, -10)]]
    return [Touch.single(patch / unit, None, unit, "digit") for patch in patches]


def motion(degrees, millimetres, unit=1.0):
    """A turn about z and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec([0, 0, degrees], degrees=True).as_matrix()
    matrix[:3, 3] = np.array(millimetres) / unit
    return matrix


def moved(touch, matrix):
    return replace(touch, points=touch.points @ matrix[:3, :3].T + matrix[:3, 3])


def registration(given, *, cloud=None, pose_error=None):
    """The first touch is kept, the second moved by 0.4 mm along z, of the third the half is used or none."""
    first, second, *third = given
    unit = first.unit
    up = motion(0, [0, 0, 0.4], unit)
    covariance = np.diag([np.radians(0.1) ** 2] * 3 + [(0.05 / unit) ** 2] * 3)
    found = [
        RegisteredTouch(
            first, np.eye(4), covariance, np.full(len(first.points), 0.05 / unit), 40, "kept", "as reported"
        ),
        RegisteredTouch(moved(second, up), up, covariance, np.full(60, 0.05 / unit), 30, "moved", "by its surface"),
    ]
    for one in third:
        none = replace(one, points=one.points[:0], finger=one.finger[:0])
        unknown = np.full((6, 6), np.inf)
        found.append(RegisteredTouch(none, np.eye(4), unknown, np.zeros(0), 2, "refused", "it fits nowhere"))
    return Registration(found, motion(0.5, [0.8, 0, 0.1], unit), covariance, 0.6, 0.2)
