"""Touches of meshes by `digit`."""

import numpy as np
import trimesh

from pcsr import ShapeItem
from tests.plugins.touch.plain_options import digit

CLOUD = np.zeros((1, 3))
IDEAL = {"object_size": None, "depth_noise": 0.0}
SHAPES = {
    "sphere": trimesh.creation.icosphere(subdivisions=4, radius=20),
    "box": trimesh.creation.box((60, 40, 30)),
    "cylinder": trimesh.creation.cylinder(radius=12, height=60),
    "torus": trimesh.creation.torus(30, 9, major_sections=80, minor_sections=40),
}


def touch(mesh, count=1, seed=0, cloud=CLOUD, **options):
    return digit(**{**IDEAL, **options}).touches(ShapeItem("part-3", "part", mesh), cloud, count, seed)


def in_sensor(touch):
    """A touch's points in its sensor's frame, in mm."""
    (pose,) = touch.poses
    inverse = np.linalg.inv(pose)
    return touch.points @ inverse[:3, :3].T + inverse[:3, 3]
