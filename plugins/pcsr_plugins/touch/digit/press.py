"""One finger comes down onto a mesh and is pressed: what a sensor then sees, without noise.

Quasi-static, without a physics engine. The gel is perfectly soft: it takes the shape of what it touches and
lifts off at once where nothing does.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from pcsr.geometry.rays import MeshRays
from pcsr.sensors.contact import CONTACT_SHARE, in_contact
from pcsr_plugins.touch.digit.sensors import Sensor
from pcsr_plugins.touch.digit.visible_pixels import promising

CONTACT = 0.05
"""Least indentation of a gel in contact, in mm, however little it is pressed; above it `CONTACT_SHARE` decides."""
COARSE = 6
"""Of so many pixels in a row one is looked at first."""
CASTS = 4
"""Times that a perspective sensor looks to find out how far down it is."""


@dataclass(frozen=True)
class Contact:
    """What a finger's camera sees, pixel by pixel, in its own frame."""

    sensor: Sensor
    pose: Float[np.ndarray, "4 4"]
    """The sensor's frame to the frame of the rays, both in mm."""
    seen: Float[np.ndarray, "rows columns 3"]
    """Where each pixel's ray meets the object, in mm; z is -inf where it does not, or is far below the contact."""
    mask: Bool[np.ndarray, "rows columns"]
    """True where that is contact."""

    @cached_property
    def pixels(self) -> int:
        """How many pixels are in contact."""
        return int(self.mask.sum())

    @cached_property
    def area(self) -> float:
        """Of the contact in planes parallel to the face, in mm²: each pixel's at its own depth."""
        z = self.seen[..., 2][self.mask]
        return float((_widening(self.sensor, z) ** 2).sum()) * self.sensor.pitch**2

    def points(self, heights: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, "m 3"]:
        """The points of the contact, row by row, moved along their rays to other heights."""
        points, z = self.seen[self.mask], heights[self.mask]
        moved = points[:, :2] * (_widening(self.sensor, z) / _widening(self.sensor, points[:, 2]))[:, None]
        return np.column_stack([moved, z])


class Finger:
    """A sensor, its rays laid out."""

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.shape = sensor.pixels[::-1]
        """Rows and columns."""
        x, y = ((np.arange(n) - (n - 1) / 2) * sensor.pitch for n in sensor.pixels)
        self.gel: Float[np.ndarray, "pixels 2"] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        """Centres of the pixels in the plane of the face, row by row, in mm."""
        self.rim = _rim(sensor)
        few = np.zeros(self.shape, bool)
        few[::COARSE, ::COARSE] = True
        self._few = few.ravel()

    def press(
        self, rays: MeshRays, point: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], depth: float
    ) -> Contact | None:
        """Come down along z from far outside until something is met, then `depth` further.

        A proximity sensor stays where it is when it meets something.

        Args:
            rays: the object.
            point: any point on the sensor's axis, in mm.
            frame: the sensor's axes as columns; z points away from the object.
            depth: in mm.

        Returns:
            None where the housing is in the way, or nothing is met.
        """
        landing = self._land(rays, point, frame, depth)
        if landing is None:
            return None
        face, surface = landing
        limit = depth if self.sensor.senses == "pressure" else 0.0
        if self.sensor.distance is None:
            seen = np.column_stack([self.gel, surface - face])
        else:
            face, seen = self._look(rays, point, frame, face, limit, self.sensor.distance)
        pressed = (seen[:, 2] - self.sag(seen)).reshape(self.shape)
        if self.sensor.reach is None:
            possible = np.where(pressed <= limit + 1e-6, pressed, -np.inf)
            mask = in_contact(possible, at_least=max(CONTACT_SHARE * depth, CONTACT))
        else:
            mask = (pressed <= 1e-6) & (seen[:, 2].reshape(self.shape) >= -self.sensor.reach)
        return Contact(self.sensor, matrix(frame, point + frame[:, 2] * face), seen.reshape(*self.shape, 3), mask)

    def sag(self, points: Float[np.ndarray, "p _"]) -> Float[np.ndarray, " p"]:
        """How far the unpressed face falls behind its centre at each x, y, in mm."""
        if self.sensor.dome is None:
            return np.zeros(len(points))
        fallen: Float[np.ndarray, " p"] = (points[:, :2] ** 2 / (2 * np.array(self.sensor.dome))).sum(1)
        return fallen

    def _land(
        self, rays: MeshRays, point: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], depth: float
    ) -> tuple[float, Float[np.ndarray, " pixels"]] | None:
        """Height above the point at which the face's centre comes to rest, and the object's height at each pixel.

        Both by parallel rays; None where the face cannot get there.
        """

        def heights(at: Float[np.ndarray, "p 2"]) -> Float[np.ndarray, " p"]:
            return rays.heights(point + at @ frame[:, :2].T, np.broadcast_to(frame[:, 2], (len(at), 3)))

        proximity = self.sensor.senses == "proximity"
        first = heights(np.concatenate([self.rim, self.gel if proximity else self.gel[self._few]]))
        of_rim, surface = np.split(first, [len(self.rim)])
        beside = float(of_rim.max(initial=-np.inf)) - self.sensor.protrusion
        if proximity:
            # A rigid finger stops at whatever is met, by its housing too.
            face = max(float((surface - self.sag(self.gel)).max()), beside)
            return (face, surface) if np.isfinite(face) else None
        # The highest point is met first, wherever it is; from there on the gel is pressed.
        lowest = float((surface - self.sag(self.gel[self._few])).max()) - depth
        bound, looked = promising(self.sensor, rays, point, frame, lowest)
        if beside > bound - depth:
            return None
        surface = np.full(len(self.gel), -np.inf)
        surface[looked] = heights(self.gel[looked])
        face = float((surface - self.sag(self.gel)).max()) - depth
        return (face, surface) if np.isfinite(face) and beside <= face else None

    def _look(
        self,
        rays: MeshRays,
        point: Float[np.ndarray, "3"],
        frame: Float[np.ndarray, "3 3"],
        face: float,
        limit: float,
        distance: float,
    ) -> tuple[float, Float[np.ndarray, "pixels 3"]]:
        """Where each pixel's ray from the camera meets the object, in the sensor's frame; and where its face is.

        What parallel rays missed between them the camera's own may meet: then the face is a little higher.
        """
        directions = np.column_stack([self.gel, np.full(len(self.gel), -distance)]) @ frame.T
        for cast in range(CASTS):
            camera = point + frame[:, 2] * (face + distance)
            # In multiples of the distance along z: a depth of 1 is at the face.
            depths = rays.depths(np.broadcast_to(camera, directions.shape), directions)
            at = self.gel * np.where(np.isfinite(depths), depths, 1.0)[:, None]
            seen = np.column_stack([at, (1 - depths) * distance])
            excess = float((seen[:, 2] - self.sag(seen)).max()) - limit
            if excess <= 1e-9 or cast == CASTS - 1:
                break
            face += excess
        return face, seen


def matrix(frame: Float[np.ndarray, "3 3"], origin: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """A rigid motion from axes as columns and an origin."""
    motion = np.eye(4)
    motion[:3, :3] = frame
    motion[:3, 3] = origin
    return motion


def _rim(sensor: Sensor) -> Float[np.ndarray, "p 2"]:
    """Points on the housing around what is seen of the face, at most 1.5 mm apart, in mm."""
    x, y = (np.linspace(-side / 2, side / 2, math.ceil(side / 1.5) + 1) for side in sensor.housing)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return grid[(np.abs(grid[:, 0]) > sensor.width / 2) | (np.abs(grid[:, 1]) > sensor.height / 2)]


def _widening(sensor: Sensor, z: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
    """How much larger than at the face a length on the image is at each height."""
    return np.ones(len(z)) if sensor.distance is None else 1 - z / sensor.distance
