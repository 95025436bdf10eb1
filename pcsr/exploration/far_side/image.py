"""Images of a cloud as it is seen from the camera: depths of the known points, orthographic."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.geometry.frames import principal_axes

PIXELS = 32
"""Width and height of an image."""
HALF = 1.15
"""Half width of an image; that of the cloud is 1."""
NEAREST = 3
"""Nearest points, beside the line of sight, of which the one that is nearest to the camera gives a pixel its depth."""
REACH = 2.2
"""Distance from a line of sight up to which points are seen in its pixel, in spacings of the points in the image."""
PITCH = 2 * HALF / PIXELS
"""Side of a pixel."""


def pixel_centres() -> Float[np.ndarray, "pixels 2"]:
    """Return x and y of the pixels, row by row."""
    at = (2 * (np.arange(PIXELS) + 0.5) / PIXELS - 1) * HALF
    x, y = np.meshgrid(at, at)
    return np.column_stack([x.ravel(), y.ravel()])


@dataclass(frozen=True)
class ViewFrame:
    """Frame of an image: x and y run across it, z towards the camera; the cloud is 2 wide."""

    axes: Float[np.ndarray, "3 3"]
    """Axes as columns."""
    centre: Float[np.ndarray, "3"]
    """Origin, along the axes."""
    scale: float
    """Length of a unit, in the unit of the cloud."""

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"], towards: Float[np.ndarray, "3"]) -> "ViewFrame":
        """Fit the frame to the points of a cloud.

        Args:
            points: the cloud.
            towards: unit vector towards the camera.
        """
        flat = points - points.mean(0)
        flat = flat - (flat @ towards)[:, None] * towards
        x = principal_axes(flat)[:, 0]
        x = x - (x @ towards) * towards
        length = float(np.linalg.norm(x))
        x = x / length if length > 1e-6 else np.cross(towards, np.eye(3)[np.abs(towards).argmin()])
        x = x / np.linalg.norm(x)
        return cls.along(points, np.column_stack([x, np.cross(towards, x), towards]))

    @classmethod
    def along(cls, points: Float[np.ndarray, "n 3"], axes: Float[np.ndarray, "3 3"]) -> "ViewFrame":
        """Fit the frame with given axes to the points of a cloud."""
        local = points @ axes
        low, high = local[:, :2].min(0), local[:, :2].max(0)
        centre = np.array([*((low + high) / 2), local[:, 2].mean()])
        return cls(axes, centre, float((high - low).max()) / 2 or 1.0)

    def local(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Map points to the frame."""
        mapped: Float[np.ndarray, "n 3"] = (points @ self.axes - self.centre) / self.scale
        return mapped

    def back(self, local: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Map points of the frame back."""
        mapped: Float[np.ndarray, "n 3"] = (local * self.scale + self.centre) @ self.axes.T
        return mapped


def image(seen: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]) -> Float[np.ndarray, "4 rows columns"]:
    """Draw known points, in the frame of the image.

    Args:
        seen: points of the cloud, at least four.
        touched: touched points.

    Returns:
        Depth of the seen surface, and 1 where there is any; depth of the touched point that is farthest from the
        camera, and 1 where there is one. Depths are 0 elsewhere.
    """
    tree = KDTree(seen[:, :2])
    spacing = float(np.median(tree.query(seen[:, :2], k=4)[0][:, 1:].mean(1)))
    distance, nearest = tree.query(pixel_centres(), k=NEAREST)
    depth = np.where(distance < max(REACH * spacing, PITCH), seen[nearest, 2], -np.inf).max(1)
    far = np.full((PIXELS, PIXELS), np.inf)
    cells = np.floor((touched[:, :2] / HALF + 1) / 2 * PIXELS).astype(np.int64)
    inside = ((cells >= 0) & (cells < PIXELS)).all(1)
    np.minimum.at(far, (cells[inside, 1], cells[inside, 0]), touched[inside, 2])
    channels = [layer for one in (depth.reshape(PIXELS, PIXELS), far) for layer in (one, np.isfinite(one))]
    return np.stack([np.where(np.isfinite(layer), layer, 0.0) for layer in channels]).astype(np.float32)
