"""Frames of clouds: normalisation to the unit sphere, with the axes kept or along the principal axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.magnitude import exponent, scaled

SMALLEST, LARGEST = 1e-300, 1e307
"""Range of radii by which doubles can be divided and multiplied without overflow or loss of precision."""
MOST_RADIUS = 3.0
"""Largest radius of a principal-axes frame, in median distances from the centroid. Clouds without stray points are
smaller: the radius of a line is 2."""
DIGITS = 7
"""Decimals of coordinates in a principal-axes frame, about the precision of float32."""


@dataclass(frozen=True)
class UnitSphere:
    """Bounding sphere of a cloud, which maps coordinates to the unit sphere and back.

    The centre is subtracted in float64 before coordinates are rounded to float32. Coordinates in the millions of
    metres thus keep their precision.
    """

    centre: Float[np.ndarray, "3"]
    """Centroid of the cloud."""
    radius: float
    """Distance of the farthest point from the centroid."""

    @classmethod
    def fit(cls, points: Float[np.ndarray, "n 3"]) -> "UnitSphere":
        """Compute the sphere around the centroid through the farthest point.

        Raises:
            UserError: the cloud is empty, not finite, without extent, or too small or large for doubles.
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
        """Map points to the unit sphere, as float32."""
        inside: Float[np.ndarray, "*k 3"] = (points.astype(np.float64) - self.centre) / self.radius
        return inside.astype(np.float32)

    def denormalize(self, points: Float[np.ndarray, "*k 3"]) -> Float[np.ndarray, "*k 3"]:
        """Map points back to the original frame and unit, as float64."""
        original: Float[np.ndarray, "*k 3"] = points.astype(np.float64) * self.radius + self.centre
        return original


@dataclass(frozen=True)
class OwnFrame:
    """Principal-axes frame of a cloud. Coordinates in it are invariant to rotation, translation and scale."""

    centre: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    radius: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "n 3"]) -> "OwnFrame":
        """Compute the frame around the centroid, with the farthest point on the unit sphere.

        A few points that are far from all others lie outside: the radius is at most `MOST_RADIUS` median distances.
        """
        centre = points.mean(0)
        distance = np.linalg.norm(points - centre, axis=1)
        median = float(np.median(distance))
        radius = min(float(distance.max()), MOST_RADIUS * median) if median > 0 else float(distance.max())
        return cls(centre, principal_axes(points), radius or 1.0)

    def normalize(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Map points to the frame, rounded to `DIGITS`. Further digits depend on the original frame and decide ties."""
        local: Float[np.ndarray, "p 3"] = np.round((points - self.centre) @ self.axes / self.radius, DIGITS)
        return local

    def denormalize(self, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Map points back to the original frame and unit."""
        outside: Float[np.ndarray, "p 3"] = points * self.radius @ self.axes.T + self.centre
        return outside


def principal_axes(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """Compute the principal axes of a cloud as the columns of a right-handed matrix, largest variance first.

    The first two axes point to the side of positive third moment. The axes rotate with the cloud, unless it is
    symmetric.
    """
    centred = points - points.mean(0)
    scale = np.abs(centred).max() or 1.0
    centred = centred / scale
    axes: Float[np.ndarray, "3 3"] = np.linalg.eigh(centred.T @ centred)[1][:, ::-1].copy()
    tails = ((centred @ axes) ** 3).sum(0)
    axes[:, :2] *= np.where(tails[:2] < 0, -1.0, 1.0)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes
