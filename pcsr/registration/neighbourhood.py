"""Touches and the cloud around each, in the frame of the touch and in millimetres."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.clouds.touch import Touch
from pcsr.registration.surface import TouchedSurface, View

AROUND = 512
"""Largest number of points of the cloud that are looked at around a touch."""
NEAREST = 4
"""Number of neighbours by which the spacing of the cloud is measured."""
FEWEST = 4
"""Smallest number of points that make a surface."""
PROJECTION = np.array([1.0, 2**0.5, 3**0.5])
"""Axis along which copies are sought: sorting numbers is faster than sorting points."""
LINE = 0.01
"""Points lie on a line if their extent across it is smaller, as a share of that along it."""


def distinct(cloud: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Return the points of a cloud without copies, in their order."""
    if len(np.unique(cloud @ PROJECTION)) == len(cloud):  # copies have the same projection
        return cloud
    kept: Float[np.ndarray, "k 3"] = cloud[np.sort(np.unique(cloud, axis=0, return_index=True)[1])]
    return kept


@dataclass(frozen=True)
class Neighbourhood:
    """One touch and the cloud around it. All lengths are in millimetres."""

    points: Float[np.ndarray, "m 3"]
    """Touched points, in the frame of the touch."""
    origin: Float[np.ndarray, "3"]
    """Centroid of the touch in the frame of the object, from the centroid of the cloud."""
    axes: Float[np.ndarray, "3 3"]
    """Axes of the touch as columns, in the frame of the object."""
    surfaces: tuple[TouchedSurface, ...]
    """Surface of each finger; without those whose points make none, such as points on a line."""
    near: Float[np.ndarray, "n 3"]
    """Points of the cloud around the touch, in its frame."""
    spacing: float
    """Spacing of the cloud there; 1 if it has fewer than two points there."""
    near_spacing: float
    """Spacing of `near`: larger, if these are only a part of the points there."""
    sensor_error: float
    """Root mean square of the expected errors of the touched points by the sensor; 0 if they are unknown."""

    @property
    def noise(self) -> float:
        """Noise of the touched points."""
        return max([self.sensor_error, *(surface.noise for surface in self.surfaces)])

    @classmethod
    def of(cls, touch: Touch, cloud: cKDTree, centre: Float[np.ndarray, "3"], margin: float) -> "Neighbourhood":
        """Bring a touch and the cloud around it into the frame of the touch.

        Args:
            touch: the touch.
            cloud: distinct points in the frame and unit of the touch.
            centre: centroid of the cloud.
            margin: distance from the touch up to which the cloud is looked at, in millimetres.
        """
        own = (touch.points - centre) * touch.unit
        origin = own.mean(0)
        axes, oriented = _axes(touch, own - origin)
        points = (own - origin) @ axes
        fingers = np.unique(touch.finger)
        surfaces = []
        for finger in fingers:
            rows = touch.finger == finger
            if len(fingers) > 1 and oriented:
                of_finger = axes.T @ _unit(touch.poses[finger])
            elif len(fingers) > 1:
                of_finger = _principal(points[rows] - points[rows].mean(0))
            else:
                of_finger = np.eye(3)
            if not _make_surface(points[rows] @ of_finger):
                continue
            view = None
            if oriented and touch.view is not None:
                view = View(((touch.poses[finger][:3, 3] - centre) * touch.unit - origin) @ axes, touch.view)
            surfaces.append(TouchedSurface.of(points[rows], of_finger, margin, oriented=oriented, view=view))
        radius = float(np.linalg.norm(points, axis=1).max()) + margin
        middle = centre + origin / touch.unit
        near = _within(cloud, middle, radius / touch.unit, axes) * touch.unit
        away = np.linalg.norm(near, axis=1)
        order = np.argsort(away, kind="stable")
        near = near[order[away[order] <= radius]]
        sensor_error = 0.0 if touch.errors is None else float(np.sqrt(np.mean(touch.errors**2))) * touch.unit
        if len(near) <= AROUND:
            spacing = _spacing(cKDTree(near), near)
            return cls(points, origin, axes, tuple(surfaces), near, spacing, spacing, sensor_error)
        some = near[np.linspace(0, len(near) - 1, AROUND).astype(int)]
        spacing = _spacing(cloud, middle + some @ axes.T / touch.unit) * touch.unit
        thinned = spacing * float(np.sqrt(len(near) / len(some)))
        return cls(points, origin, axes, tuple(surfaces), some, spacing, thinned, sensor_error)


def _within(
    cloud: cKDTree, centre: Float[np.ndarray, "3"], radius: float, axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "n 3"]:
    """Return the points of the cloud in a ball, along axes at its centre."""
    rows = np.asarray(cloud.query_ball_point(centre, radius * (1 + 1e-9)), np.int64)
    found: Float[np.ndarray, "n 3"] = (cloud.data[rows] - centre) @ axes
    return found


def _axes(touch: Touch, centred: Float[np.ndarray, "m 3"]) -> tuple[Float[np.ndarray, "3 3"], bool]:
    """Return the axes of a touch, and whether the last is known to point out of the object."""
    if len(touch.poses):
        return _unit(touch.poses[0]), True
    return _principal(centred), False


def _unit(pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "3 3"]:
    axes: Float[np.ndarray, "3 3"] = pose[:3, :3] / np.cbrt(np.linalg.det(pose[:3, :3]))
    return axes


def _principal(centred: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the principal axes of points, the shortest last. Their signs follow the points, not the frame."""
    axes = np.linalg.eigh(centred.T @ centred)[1][:, ::-1].copy()
    signs = np.sign(((centred @ axes) ** 3).sum(0))
    axes = axes * np.where(signs == 0, 1, signs)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes


def _make_surface(points: Float[np.ndarray, "m 3"]) -> bool:
    """Return whether points make a surface over the plane of their first two axes: some that don't lie on a line."""
    if len(points) < FEWEST:
        return False
    short, long = np.linalg.eigvalsh(np.cov(points[:, :2].T))
    return bool(short > LINE**2 * long)


def _spacing(cloud: cKDTree, points: Float[np.ndarray, "k 3"]) -> float:
    """Return the median over some points of a cloud of the mean distance to their nearest; 1 for a cloud of one."""
    if cloud.n < 2:
        return 1.0
    k = min(NEAREST, cloud.n - 1)
    return float(np.median(cloud.query(points, k=range(2, k + 2))[0].mean(1)))
