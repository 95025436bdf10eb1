"""Meshes in grey and points in colour, seen in parallel from a direction: what the pictures here are made with."""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, UInt8
from PIL import Image

BEHIND = 3
"""Rays for a pixel, each way: their mean softens edges."""
LIGHT = np.array((-0.45, 0.6, 0.66))


@dataclass(frozen=True)
class View:
    """A square window of the plane at right angles to the line of sight."""

    towards: tuple[float, float, float]
    """From the object to the viewer."""
    centre: Float[np.ndarray, "3"]
    half: float
    """Half the window's side, in the object's unit."""
    size: int
    """Pixels along the side."""

    @property
    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Right, up and towards the viewer as rows; the object's z points up."""
        z = np.asarray(self.towards, float) / np.linalg.norm(self.towards)
        x = np.cross((0, 0, 1), z)
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    def mesh(self, mesh: trimesh.Trimesh) -> Float[np.ndarray, "size size"]:
        """Brightness, 1 where nothing is hit."""
        fine = self.size * BEHIND
        steps = ((np.arange(fine) + 0.5) / fine * 2 - 1) * self.half
        x, y = np.meshgrid(steps, -steps)
        far = float(np.ptp(mesh.vertices @ self.axes[2])) + self.half
        origins = self.centre + x.reshape(-1, 1) * self.axes[0] + y.reshape(-1, 1) * self.axes[1]
        faces = mesh.ray.intersects_first(origins + far * self.axes[2], np.tile(-self.axes[2], (fine**2, 1)))
        shade = 0.25 + 0.65 * np.clip(mesh.face_normals @ (LIGHT @ self.axes), 0, 1)
        pixels = np.where(faces < 0, 1.0, shade[faces]).reshape(self.size, BEHIND, self.size, BEHIND)
        return np.asarray(pixels.mean(axis=(1, 3)))

    def dots(
        self,
        image: Float[np.ndarray, "size size 3"],
        points: Float[np.ndarray, "n 3"],
        colours: Float[np.ndarray, "n 3"],
        radius: float = 1.5,
    ) -> None:
        """Draw points into an image, the farthest first; `radius` in pixels."""
        seen = (points - self.centre) @ self.axes.T
        order = np.argsort(seen[:, 2])
        columns = (seen[:, 0] / self.half + 1) / 2 * self.size
        rows = (1 - seen[:, 1] / self.half) / 2 * self.size
        reach = int(np.ceil(radius))
        for k in order:
            for i in range(int(rows[k]) - reach, int(rows[k]) + reach + 1):
                for j in range(int(columns[k]) - reach, int(columns[k]) + reach + 1):
                    inside = (i + 0.5 - rows[k]) ** 2 + (j + 0.5 - columns[k]) ** 2 <= radius**2
                    if inside and 0 <= i < self.size and 0 <= j < self.size:
                        image[i, j] = colours[k]


def save(image: Float[np.ndarray, "h w *c"], path: str) -> None:
    """As a PNG of a few colours: more would hardly show, and would not compress."""
    pixels: UInt8[np.ndarray, "h w *c"] = np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)
    picture = Image.fromarray(pixels)
    (picture.quantize(32) if pixels.ndim == 2 else picture.quantize(96)).save(path, optimize=True)
