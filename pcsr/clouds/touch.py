"""One touch: the patch of surface that a fingertip felt, and where the finger was."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


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
    """Area of the contact, in square millimetres."""
