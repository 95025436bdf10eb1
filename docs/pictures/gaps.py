"""Draw what becomes of a part that was seen from one side only: how the picture of docs/upsample.md is made.

Left: the points that the camera saw, from where it stood and from the side. Right: four times as many. What nobody saw
stays empty, and so do the holes.

python docs/pictures/gaps.py docs/pictures/gaps.png
"""

import sys

import numpy as np
from jaxtyping import Float
from shading import View, save

import pcsr
from pcsr.data.view import seen_points
from pcsr.recipe import View as Camera
from pcsr_plugins.shapes.cad_parts import CadParts

PART = "test/bracket/0001"
SIZE = 300
POINTS = 1500
INK = np.array((0.15, 0.25, 0.35))


def picture(points: Float[np.ndarray, "n 3"], view: View, mesh: object) -> Float[np.ndarray, "size size 3"]:
    """Dots over a pale part."""
    image = 1 - 0.35 * (1 - np.repeat(view.mesh(mesh)[..., None], 3, axis=2))
    view.dots(image, points, np.tile(INK, (len(points), 1)), 1.0)
    return image


if __name__ == "__main__":
    mesh = CadParts().item(PART).mesh
    camera = Camera(cameras=1, noise=0.002)
    seen = seen_points(mesh, POINTS, camera, np.random.default_rng(3), PART)
    dense = pcsr.load().upsample(seen, rate=4)
    middle, half = mesh.bounds.mean(0), 0.62 * float(np.linalg.norm(mesh.extents))
    front = seen.mean(0) - middle
    views = [View(tuple(way), middle, half, SIZE) for way in (front, np.cross(front, (0.0, 0.0, 1.0)))]
    panels = [picture(cloud, view, mesh) for cloud in (seen, dense) for view in views]
    save(np.hstack(panels), sys.argv[1])
