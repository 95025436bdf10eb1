"""Draw one touch on one part as a PNG: how the picture of docs/touch.md is made.

Left: the part with the outline of the gel and the touched points. Middle: the same from close by. Right: the touched
points alone, in the sensor's own frame, coloured by how deep they press in.

python docs/pictures/touch.py docs/pictures/touch.png
"""

import sys

import numpy as np
from jaxtyping import Float
from shading import View, save

from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.noise import Noise

PART = "test/handwheel/0001"
SIZE = 360
RED = np.array((0.82, 0.13, 0.17))
BLUE = np.array((0.12, 0.44, 0.70))
SHALLOW, DEEP = np.array((0.12, 0.44, 0.70)), np.array((0.95, 0.62, 0.10))


def outline(pose: Float[np.ndarray, "4 4"], width: float, height: float) -> Float[np.ndarray, "n 3"]:
    """Points along the edge of the gel, in the object's frame."""
    t = np.linspace(-0.5, 0.5, 240)
    side = np.full_like(t, 0.5)
    x = np.concatenate([t, t, side, -side]) * width
    y = np.concatenate([side, -side, t, t]) * height
    return np.column_stack([x, y, np.zeros(len(x)), np.ones(len(x))]) @ pose.T[:, :3]


if __name__ == "__main__":
    item = CadParts().item(PART)
    digit = Digit(points=4000, noise=Noise(depth_noise=0.0))
    touch = digit.touches(item, np.zeros((1, 3)), 1, seed=2)[0]
    pose = touch.poses[0]
    edge = outline(pose, digit.sensor.width, digit.sensor.height)
    above = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    slant = tuple(above + 0.6 * pose[:3, 0] / np.linalg.norm(pose[:3, 0]) + np.array((0.2, -0.5, 0.3)))
    panels = []
    for centre, half in (
        (item.mesh.bounds.mean(0), 0.62 * float(item.mesh.extents.max())),
        (pose[:3, 3], 11 / touch.unit),
    ):
        view = View(slant, centre, half, SIZE)
        image = np.repeat(view.mesh(item.mesh)[..., None], 3, axis=2)
        view.dots(image, touch.points, np.tile(RED, (len(touch.points), 1)), 1.1)
        view.dots(image, edge, np.tile(BLUE, (len(edge), 1)), 1.1)
        panels.append(image)
    local = np.column_stack([touch.points, np.ones(len(touch.points))]) @ np.linalg.inv(pose).T[:, :3]
    depth = (local[:, 2] / local[:, 2].max())[:, None]
    view = View((0.6, -0.8, 0.9), np.array((0.0, 0.0, local[:, 2].mean())), 9.0, SIZE)
    image = np.ones((SIZE, SIZE, 3))
    view.dots(image, local, (1 - depth) * SHALLOW + depth * DEEP, 1.4)
    panels.append(image)
    save(np.hstack(panels), sys.argv[1])
