"""Frames of clouds, centred on the cloud with its farthest point on the unit sphere: parallel or along its axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.magnitude import exponent, scaled

SMALLEST, LARGEST = 1e-300, 1e307
"""Radii with which doubles divide and multiply without loss."""
DIGITS = 7
"""Decimals of coordinates in a patch's own frame: about what single precision holds."""


@dataclass(frozen=True)
class UnitSphere:
    """Maps any frame and unit to the unit sphere and back.

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

    def normalize(self, points: Float[np.ndarray, "*k 3"]) -> Float[np.ndarray, "*k 3"]:
        """Into the unit sphere; float32."""
        inside: Float[np.ndarray, "*k 3"] = (points.astype(np.float64) - self.centre) / self.radius
        return inside.astype(np.float32)

    def denormalize(self, points: Float[np.ndarray, "*k 3"]) -> Float[np.ndarray, "*k 3"]:
        """Back to the original frame and unit; float64."""
        original: Float[np.ndarray, "*k 3"] = points.astype(np.float64) * self.radius + self.centre
        return original


@dataclass(frozen=True)
class OwnFrame:
    """A frame along the principal axes of a cloud: rotated, moved and scaled, the cloud looks the same in it."""

    centre: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    radius: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"]) -> "OwnFrame":
        """The frame centred on the cloud, along the cloud's principal axes, its farthest point on the unit sphere."""
        centre = points.mean(0)
        radius = float(np.linalg.norm(points - centre, axis=1).max())
        return cls(centre, principal_axes(points), radius or 1.0)

    def normalize(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Into the frame, rounded to `DIGITS`: digits behind depend on where the cloud was, and would decide ties."""
        local: Float[np.ndarray, "p 3"] = np.round((points - self.centre) @ self.axes / self.radius, DIGITS)
        return local

    def denormalize(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Back to the original frame and unit."""
        outside: Float[np.ndarray, "p 3"] = points * self.radius @ self.axes.T + self.centre
        return outside


def principal_axes(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """A right-handed frame of the cloud's own, as columns: widest spread first, each to the side of the longer tail.

    It turns with the cloud, unless the cloud is symmetric.
    """
    centred = points - points.mean(0)
    scale = np.abs(centred).max() or 1.0
    centred = centred / scale
    axes: Float[np.ndarray, "3 3"] = np.linalg.eigh(centred.T @ centred)[1][:, ::-1].copy()
    tails = ((centred @ axes) ** 3).sum(0)
    axes[:, :2] *= np.where(tails[:2] < 0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes
