"""The frame that networks see: centred on the cloud, its farthest point on the unit sphere."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.magnitude import exponent, scaled

SMALLEST, LARGEST = 1e-300, 1e307
"""Radii with which doubles divide and multiply without loss."""


@dataclass(frozen=True)
class UnitSphere:
    """Maps a frame and unit of a person's own to the unit sphere and back.

    The centre is subtracted in float64, before anything is rounded to float32, so that coordinates in the
    millions of metres keep their precision.
    """

    centre: Float[np.ndarray, "3"]
    radius: float

    @classmethod
    def fit(cls, points: Float[np.ndarray, "n 3"]) -> "UnitSphere":
        """The sphere about the centroid that reaches the farthest point.

        Raises:
            UserError: the cloud is empty, not finite, all on one spot, or at the end of what doubles hold.
        """
        cloud = np.asarray(points, np.float64)
        check_cloud(cloud, extent=True)
        power = exponent([cloud])
        cloud = scaled(cloud, -power)
        centre = cloud.mean(0)
        radius = float(np.linalg.norm(cloud - centre, axis=1).max())
        with np.errstate(over="ignore", under="ignore"):
            sphere = cls(scaled(centre, power), float(np.ldexp(radius, power)))
        if not SMALLEST <= sphere.radius <= LARGEST:
            raise UserError(
                f"the cloud's radius is {sphere.radius:.4g}: radii of {SMALLEST:g} to {LARGEST:g} can be scaled to 1: "
                f"take another unit"
            )
        return sphere

    def apply(self, points: Float[np.ndarray, "*k 3"]) -> Float[np.ndarray, "*k 3"]:
        """Into the unit sphere; float32."""
        inside: Float[np.ndarray, "*k 3"] = (points.astype(np.float64) - self.centre) / self.radius
        return inside.astype(np.float32)

    def undo(self, points: Float[np.ndarray, "*k 3"]) -> Float[np.ndarray, "*k 3"]:
        """Back to the original frame and unit; float64."""
        original: Float[np.ndarray, "*k 3"] = points.astype(np.float64) * self.radius + self.centre
        return original
