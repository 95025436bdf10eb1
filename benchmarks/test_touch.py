"""Touches a second, on one core: all places tried, refused ones too. Asked for: 60 with 121 x 121 rays.

make bench ARGS=benchmarks/test_touch.py
"""

import numpy as np
import pytest
import trimesh

from pcsr import Item
from pcsr.geometry.rays import MeshRays
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit

CLOUD = np.zeros((1, 3))
TOUCHES = 40
RAYS = 121


def part_of_10_000_triangles():
    """The generated part whose number of triangles is next to 10,000."""
    shapes = CadParts()
    items = [shapes.item(name) for name in shapes.names("train")[:96]]
    return min(items, key=lambda item: abs(len(item.mesh.faces) - 10_000))


MESHES = {
    "torus": lambda: Item("torus", "torus", trimesh.creation.torus(30, 9, major_sections=100, minor_sections=50)),
    "cad-part": part_of_10_000_triangles,
}


@pytest.mark.parametrize("name", MESHES)
def test_touches(benchmark, name):
    item = MESHES[name]()
    digit = Digit(width=16.0, height=16.0, pixels=RAYS)
    touches = benchmark(digit.touches, item, CLOUD, TOUCHES, 0)
    benchmark.extra_info["triangles"] = len(item.mesh.faces)
    benchmark.extra_info["touches a second"] = round(TOUCHES / benchmark.stats["mean"], 1)
    assert len(touches) == TOUCHES


@pytest.mark.parametrize("name", MESHES)
def test_the_rays_alone(benchmark, name):
    """What cannot be saved: one image of rays for each touch, by the library that casts them."""
    item = MESHES[name]()
    rays = MeshRays(item.mesh, 60.0, item.name)
    places = np.stack(np.meshgrid(*[np.linspace(-8, 8, RAYS)] * 2, [0.0]), -1).reshape(-1, 3)
    up = np.broadcast_to((0.0, 0.0, 1.0), places.shape)
    benchmark(rays.heights, places, up)
    benchmark.extra_info["triangles"] = len(item.mesh.faces)
    benchmark.extra_info["images a second"] = round(1 / benchmark.stats["mean"], 1)
