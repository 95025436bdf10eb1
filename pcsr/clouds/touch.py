"""One touch: the patch of surface that a fingertip felt, and where the finger was."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree


@dataclass(frozen=True)
class Touch:
    """The points that one touch felt, in the object's frame and unit.

    `pose` maps the sensor's frame (metric, unit `mm`) to the object's: its rotation part carries the scale
    between millimetres and the object's unit.
    """

    points: Float[np.ndarray, "m 3"]
    """Contact points in the object's frame and unit."""
    pose: Float[np.ndarray, "4 4"]
    """Sensor to object; the sensor looks along its own -z, in millimetres."""
    sensor: str
    """Name of the sensor that felt it."""
    contact_area: float
    """Area of the contact in the gel's plane, in square millimetres."""

    @property
    def scale(self) -> float:
        """Length of one millimetre in the object's unit."""
        return float(np.cbrt(abs(np.linalg.det(self.pose[:3, :3]))))


def coverage(touches: Sequence[Touch], area: float) -> float:
    """The share of an object's surface that its touches felt, from 0 to 1; what two felt counts once.

    A touch adds its contact area, less the share of its points that lie among those of an earlier touch. The
    contact is measured in the gel's plane, so that on slopes the coverage is a little low.

    Args:
        touches: of one object.
        area: the object's whole surface, in its own unit squared, as `trimesh.Trimesh.area` gives it.
    """
    felt = 0.0
    for index, touch in enumerate(touches):
        new = np.ones(len(touch.points), bool)
        for earlier in touches[:index]:
            # A disc about each of its points, four times its share of the contact: gaps between points are
            # rarer than 2 %, and the contact grows by little.
            radius = np.sqrt(4 * earlier.contact_area / (np.pi * len(earlier.points))) * earlier.scale
            distance, _ = KDTree(earlier.points).query(touch.points, distance_upper_bound=radius)
            new &= ~np.isfinite(distance)
        felt += touch.contact_area * touch.scale**2 * float(new.mean())
    return min(1.0, felt / area)
