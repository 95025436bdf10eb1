"""Candidates of a touch: random points of the surface, with a pose of the sensor at each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pcsr.geometry.rays import MeshRays


@dataclass(frozen=True)
class Candidates:
    """Candidates of one touch, in the frame of the rays, in mm."""

    points: Float[np.ndarray, "p 3"]
    """On the surface, uniform by area."""
    frames: Float[np.ndarray, "p 3 3"]
    """The sensor's axes as columns; z points out of the object."""
    presses: Float[np.ndarray, " p"]
    """How deep to press there."""
    open: Bool[np.ndarray, " p"]
    """True where the candidate is the first point that the sensor's axis meets."""

    @classmethod
    def draw(
        cls,
        rays: MeshRays,
        count: int,
        tilt: float,
        press: tuple[float, float],
        rngs: Sequence[np.random.Generator],
    ) -> list["Candidates"]:
        """`count` of them for each of several touches, their rays cast at once.

        Args:
            rays: the object.
            count: how many.
            tilt: standard deviation of the angle between axis and normal, in degrees, cut off at twice that.
            press: least and greatest depth, in mm.
            rngs: one for each touch alone.
        """
        drawn = []
        for rng in rngs:
            points, normals = rays.surface_points(count, rng)
            angle = np.radians(np.clip(rng.normal(size=count), -2, 2) * tilt)
            towards, yaw = rng.uniform(0, 2 * np.pi, (2, count))
            drawn.append((points, normals, angle, towards, yaw, rng.uniform(*press, count)))
        if not drawn:
            return []
        points, normals, angle, towards, yaw, presses = map(np.concatenate, zip(*drawn, strict=True))
        frames = _frames(normals, angle, towards, yaw)
        # Which side of a face is outside is asked of the rays: the faces of a careless mesh may be turned.
        above = rays.heights(points, frames[:, :, 2])
        below = rays.heights(points, -frames[:, :, 2])
        tolerance = 1e-5 * rays.reach
        turned = np.abs(above) > tolerance
        frames[turned] *= np.array([1.0, -1.0, -1.0])
        is_open = ~turned | (np.abs(below) < tolerance)
        parts = (np.split(array, len(rngs)) for array in (points, frames, presses, is_open))
        return [cls(*part) for part in zip(*parts, strict=True)]


def _frames(
    normals: Float[np.ndarray, "p 3"],
    angle: Float[np.ndarray, " p"],
    towards: Float[np.ndarray, " p"],
    yaw: Float[np.ndarray, " p"],
) -> Float[np.ndarray, "p 3 3"]:
    """Sensor axes as columns: z along the normal but for a small tilt in some direction; turned by a yaw."""
    z = np.cos(angle)[:, None] * normals + np.sin(angle)[:, None] * _across(normals, towards)
    x = _across(z, yaw)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _across(axes: Float[np.ndarray, "p 3"], angles: Float[np.ndarray, " p"]) -> Float[np.ndarray, "p 3"]:
    """Unit vectors at right angles to unit vectors, turned about these by `angles`, in radians."""
    first = np.cross(np.eye(3)[np.abs(axes).argmin(1)], axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axes, first)
    turned: Float[np.ndarray, "p 3"] = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    return turned
