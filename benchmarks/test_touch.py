"""Touches on one core: with every try, also those without a contact. Asked for: 60 a second with 121 x 121 rays.

make bench ARGS=benchmarks/test_touch.py
"""

import numpy as np
import pytest
import trimesh

from pcsr import ShapeItem
from pcsr.geometry.rays import MeshRays
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.press import Finger
from pcsr_plugins.touch.digit.sensors import SensorOptions

CLOUD = np.zeros((1, 3))
TOUCHES = 40
RAYS = 121
DIGIT = {"sensor": SensorOptions(width=16.0, height=16.0, pixels=RAYS)}


def part_of_10_000_triangles():
    """The generated part whose number of triangles is next to 10,000."""
    shapes = CadParts()
    items = [shapes.item(name) for name in shapes.names("train")[:96]]
    return min(items, key=lambda item: abs(len(item.mesh.faces) - 10_000))


MESHES = {
    "torus": lambda: ShapeItem("torus", "torus", trimesh.creation.torus(30, 9, major_sections=100, minor_sections=50)),
    "cad-part": part_of_10_000_triangles,
}


@pytest.fixture(scope="module", params=MESHES)
def item(request):
    return MESHES[request.param]()


@pytest.fixture
def what(item):
    return f"{TOUCHES} touches of {item.name}, {len(item.mesh.faces):,} triangles, {RAYS} × {RAYS} rays"


def test_touches(benchmark, line, item, what):
    line(what, "ours", "≥ 60 touches a second")
    touches = benchmark(Digit(**DIGIT).touches, item, CLOUD, TOUCHES, 0)
    assert len(touches) == TOUCHES
    benchmark.extra_info["says"] = f"{TOUCHES / benchmark.stats['min']:.0f} touches a second"


def test_the_rays_alone(benchmark, line, item, what):
    """One image of rays for each touch, from where it was found, by the library that casts them."""
    line(what, "limit")
    digit = Digit(**DIGIT)
    rays = MeshRays(item.mesh, digit.object_size, item.name)
    gel = Finger(digit.sensor).gel
    images = []
    for touch in digit.touches(item, CLOUD, TOUCHES, 0):
        pose = np.linalg.inv(rays.to_object) @ touch.poses[0]
        x, y, z = (axis / np.linalg.norm(axis) for axis in pose[:3, :3].T)
        images.append((pose[:3, 3] + gel @ np.stack([x, y]), np.broadcast_to(z, (len(gel), 3))))
    benchmark(lambda: [rays.heights(*image) for image in images])
