"""Draw two objects of each family, lit from above, as a PNG: how the pictures of docs/shapes.md are made.

python docs/pictures/contact_sheet.py docs/pictures/cad-parts.png   # or blobs.png: the file's name says which shapes
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float
from shading import View, save

from pcsr_plugins.shapes.blobs import Blobs
from pcsr_plugins.shapes.cad_parts import CadParts


def picture(mesh: trimesh.Trimesh, size: int) -> Float[np.ndarray, "size size"]:
    """An object, from the front, right and above."""
    view = View((1.0, -1.4, 0.9), mesh.bounds.mean(0), 1.0, size)
    seen = mesh.vertices @ view.axes.T
    middle = (seen.min(0) + seen.max(0)) / 2
    half = 0.54 * float(np.ptp(seen[:, :2], axis=0).max())
    return View(view.towards, middle @ view.axes, half, size).mesh(mesh)


def sheet(meshes: Sequence[trimesh.Trimesh], columns: int, size: int) -> Float[np.ndarray, "h w"]:
    """Row after row of pictures."""
    pictures = [picture(mesh, size) for mesh in meshes]
    pictures += [np.ones((size, size))] * (-len(meshes) % columns)
    return np.vstack([np.hstack(pictures[i : i + columns]) for i in range(0, len(pictures), columns)])


if __name__ == "__main__":
    shapes = {"cad-parts": CadParts, "blobs": Blobs}[Path(sys.argv[1]).stem]()
    names = sorted(shapes.names("train")[: 2 * len(shapes.families)])  # two of each family, side by side
    save(sheet([shapes.item(name).mesh for name in names], columns=12, size=96), sys.argv[1])
