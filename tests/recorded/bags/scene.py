"""A ball of 30 mm before a camera that a sensor on an arm touches, recorded in a bag.

The transforms are camera - base - arm - tool - gel, of which base to arm and arm to tool move; the object's frame is
the camera's. All lengths are in metres unless their name says mm.
"""

import numpy as np
from scipy.spatial.transform import Rotation

BALL, CENTRE = 0.030, np.array([0.02, -0.01, 0.4])
TOUCHED = (np.array([0.8, 0.0, 0.6]), np.array([0.0, -0.6, 0.8]))
"""Directions from the ball's centre in which it is touched, on the side that the camera does not see."""
PRESS_MM = (0.9, 1.2)
"""How deep each touch is."""
TIMES = (3.0, 8.0)
"""Middle of each touch, in seconds."""
END, RATE = 11.0, 20
"""Length of the recording in seconds, and messages a second."""
BASE = (np.array([0.1, 0.2, 0.9]), Rotation.from_euler("xyz", [120, 10, 35], degrees=True))
"""Pose of the base in the camera's frame."""
GEL = (np.array([0, 0, 0.05]), Rotation.from_euler("x", 90, degrees=True))
"""Pose of the gel in the tool's frame."""


def visible():
    """Points of the ball that the camera sees."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(600, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return CENTRE + BALL * directions[directions[:, 2] < 0]


def pressed_mm(time):
    """How deep the gel is pressed at a time, and the number of the touch."""
    touch = int(np.argmin([abs(time - middle) for middle in TIMES]))
    return PRESS_MM[touch] * max(0.0, 1 - (time - TIMES[touch]) ** 2), touch


def gel_pose(time):
    """Pose of the gel's face in the camera's frame: position and rotation; its z leads out of the ball."""
    press, touch = pressed_mm(time)
    outward = TOUCHED[touch]
    away = 0.0 if press else 0.02 * (abs(time - TIMES[touch]) - 1)
    position = CENTRE + (BALL - press / 1000 + away) * outward
    side = np.cross([0.0, 1.0, 0.3], outward)
    side /= np.linalg.norm(side)
    return position, Rotation.from_matrix(np.stack([side, np.cross(outward, side), outward], axis=1))


def contact(time):
    """Contact points in the frame of the gel, z out of the ball."""
    press, _ = pressed_mm(time)
    if press <= 0:
        return np.zeros((0, 3))
    rim = np.sqrt(BALL**2 - (BALL - press / 1000) ** 2)
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 16, endpoint=False), np.linspace(0.05, 0.98, 10) * rim)
    x, y = (radius * np.cos(angle)).reshape(-1), (radius * np.sin(angle)).reshape(-1)
    return np.stack([x, y, np.sqrt(BALL**2 - x**2 - y**2) - (BALL - press / 1000)], axis=1)


def after(one, other):
    """Composition of two poses: the second, in the frame of the first."""
    return one[0] + one[1].apply(other[0]), one[1] * other[1]


def inverse(pose):
    back = pose[1].inv()
    return -back.apply(pose[0]), back


def times():
    return np.arange(0, END, 1 / RATE)


def write_poses(bag, *, frame="gel"):
    """Transforms at other times than the touches, and a topic of poses of the gel."""
    bag.transform("base", "camera", 0.0, BASE[0], BASE[1].as_quat(), static=True)
    bag.transform(frame, "tool", 0.0, GEL[0], GEL[1].as_quat(), static=True)
    for time in times() + 0.013:
        tool = after(gel_pose(time), inverse(GEL))
        in_base = after(inverse(BASE), tool)
        arm = (np.array([0.3, 0.1, 0.2 + 0.01 * time]), Rotation.from_euler("z", 3 * time, degrees=True))
        in_arm = after(inverse(arm), in_base)
        bag.transform("arm", "base", time, arm[0], arm[1].as_quat())
        bag.transform("tool", "arm", time, in_arm[0], in_arm[1].as_quat())
        position, rotation = after(inverse(BASE), gel_pose(time))
        bag.pose("/gel_pose", time, position, rotation.as_quat(), frame="base")


def write_scene(bag, *, frame="gel", **layout):
    """A whole recording: the camera's cloud, the sensor's contact clouds, transforms and poses."""
    with bag:
        bag.cloud("/camera/points", 0.5, visible(), frame="camera")
        write_poses(bag, frame=frame)
        for time in times():
            points = contact(time)
            points = np.concatenate([points, np.full((3, 3), np.nan)])
            bag.cloud("/gel/points", time, points, frame=frame, **layout)
    return bag.path


def off_ball(points):
    """Greatest distance of points, in the camera's frame, from the ball."""
    return float(np.abs(np.linalg.norm(points - CENTRE, axis=1) - BALL).max())
