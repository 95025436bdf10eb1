"""The errors of a tactile sensor, each a term of its own: of the heights that it measures, and of its poses.

Every random term has a random stream of its own. Setting one changes nothing about the others.
"""

import math
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pcsr import Options, PoseError

WAVES = 128
"""Number of plane waves of a drift field."""


Deviation = Annotated[float, Field(ge=0, le=1000)]
Angle = Annotated[float, Field(ge=0, le=180)]


class Noise(Options):
    """Terms of the sensor's error; 0 means: no such error."""

    blur: Deviation = 0.0
    """Standard deviation of a lateral Gaussian, in mm."""
    drift: Deviation = 0.0
    """Standard deviation of a slowly varying error of the height, in mm."""
    drift_length: Annotated[float, Field(gt=0, le=1000)] = 4.0
    """Over this distance, in mm, the correlation of the drift falls to exp(-1/2) = 0.61."""
    depth_noise: Deviation = 0.02
    """Standard deviation of the height of each pixel, in mm."""
    quantum: Deviation = 0.0
    """Step of the heights, in mm."""
    position_noise: Deviation = 0.0
    """Standard deviation of the pose's error along each axis, in mm."""
    rotation_noise: Angle = 0.0
    """Standard deviation of the pose's error about each axis, in degrees."""
    shared_position_noise: Deviation = 0.0
    """Standard deviation, along each axis in mm, of an error that all touches of an object share."""
    shared_rotation_noise: Angle = 0.0
    """Standard deviation, about each axis in degrees, of an error that all touches of an object share."""

    @property
    def shared(self) -> bool:
        """Whether the touches of an object share an error."""
        return self.shared_position_noise > 0 or self.shared_rotation_noise > 0

    @property
    def expected_pose_error(self) -> PoseError:
        """Deviations of the poses, of each touch and shared ones together, up to the largest that can be stated."""
        position = math.hypot(self.position_noise, self.shared_position_noise)
        rotation = math.hypot(self.rotation_noise, self.shared_rotation_noise)
        return PoseError.at_most(position, rotation)

    def heights(
        self,
        heights: Float[np.ndarray, "rows columns"],
        contact: Bool[np.ndarray, "rows columns"],
        pitch: float,
        rng: np.random.Generator,
    ) -> Float[np.ndarray, "rows columns"]:
        """What is measured of the surface, in this order: blurred, drifted, noisy, in steps.

        Args:
            heights: above the unpressed face's plane, in mm; outside of the contact they may be infinite.
            contact: where they are measured; elsewhere they stay.
            pitch: side of a pixel, in mm.
            rng: for this touch alone.
        """
        drifting, white = rng.spawn(2)
        measured = heights.copy()
        if self.blur > 0:
            measured = blurred(measured, contact, self.blur / pitch)
        if self.drift > 0:
            positions = (np.argwhere(contact) - (np.array(contact.shape) - 1) / 2) * pitch
            field = smooth_field(positions, self.drift_length, drifting)
            measured[contact] += self.drift * field
        # One number for each pixel, in contact or not: the numbers do not depend on the contact.
        measured[contact] += self.depth_noise * white.normal(size=heights.shape)[contact]
        if self.quantum > 0:
            measured[contact] = np.round(measured[contact] / self.quantum) * self.quantum
        return measured

    def pose_error(self, rng: np.random.Generator) -> Float[np.ndarray, "4 4"]:
        """A small rigid motion, in mm, in the sensor's own frame."""
        return _motion(self.position_noise, self.rotation_noise, rng)

    def shared_error(self, rng: np.random.Generator) -> Float[np.ndarray, "4 4"]:
        """The rigid motion that all touches of an object share, in mm, about the centre of its bounding box."""
        return _motion(self.shared_position_noise, self.shared_rotation_noise, rng)


def _motion(position: float, rotation: float, rng: np.random.Generator) -> Float[np.ndarray, "4 4"]:
    """A rotation vector and a translation with normal coordinates of these deviations, in degrees and mm."""
    turning, moving = rng.normal(size=(2, 3))
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(turning * rotation, degrees=True).as_matrix()
    motion[:3, 3] = moving * position
    return motion


def blurred(
    heights: Float[np.ndarray, "rows columns"], contact: Bool[np.ndarray, "rows columns"], sigma: float
) -> Float[np.ndarray, "rows columns"]:
    """A Gaussian mean of the heights over the contact alone: what is outside has no weight.

    Args:
        heights: in any unit.
        contact: where they count, and where they change.
        sigma: in pixels.
    """
    weight = ndimage.gaussian_filter(contact.astype(np.float64), sigma, mode="constant")
    total = ndimage.gaussian_filter(np.where(contact, heights, 0.0), sigma, mode="constant")
    return np.where(contact, total / np.where(contact, weight, 1.0), heights)


def smooth_field(
    positions: Float[np.ndarray, "p 2"], length: float, rng: np.random.Generator
) -> Float[np.ndarray, " p"]:
    """A random field with standard deviation 1 and the correlation exp(-d² / (2 length²)) at distance d.

    A sum of plane waves whose wave vectors are normal: the field is the same whatever the pixels.
    """
    waves = rng.normal(size=(2, WAVES)) / length
    phases = rng.uniform(0, 2 * np.pi, WAVES)
    field: Float[np.ndarray, " p"] = np.sqrt(2 / WAVES) * np.cos(positions @ waves + phases).sum(1)
    return field
