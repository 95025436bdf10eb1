"""Contact of a tactile sensor in one message, and what the readers of its topics have in common."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Float64

from pcsr.recorded.fields import Axis
from pcsr.recorded.pose import offset_z, rotation_from

METRE = 1000.0
"""Unit of point clouds and transforms in ROS, in mm (REP 103)."""
STRAY, MOST_STRAY = 0.01, 10
"""Share of the deepest points or pixels that may be stray, and their greatest number."""


@dataclass(frozen=True)
class Pressed:
    """Contact of a sensor in one message."""

    points: Float64[np.ndarray, "m 3"]
    """Contact points in pcsr's frame of the sensor, in mm."""
    depth: float
    """Greatest indentation of the gel in mm, without stray points."""
    area: float | None = None
    """Contact area in mm²; None if unknown."""
    entry: dict[str, Any] | None = None
    """Keys of the manifest's entry of an image; None for a cloud, whose points are written."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Content of the files that the entry names."""


class TactileTopic(ABC):
    """Reader of the messages of one topic of a tactile sensor."""

    @abstractmethod
    def indentation(self, content: Any) -> float:
        """Return the greatest indentation of the gel in a message, in mm, without stray points; 0 without contact.

        Raises:
            UserError: the message is damaged.
        """

    @abstractmethod
    def pressed(self, content: Any, name: str) -> Pressed:
        """Return the contact in a message.

        Args:
            content: content of the message.
            name: name of the files of an image, without suffix.

        Raises:
            UserError: there is no contact, or the message is damaged.
        """

    @property
    def sensor(self) -> str | None:
        """Name of the sensor; None if it is unknown."""
        return None

    def shared(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Return the keys of the manifest that all images share, and the content of the files that they name."""
        return {}, {}


def greatest(indentation: Float[np.ndarray, "..."]) -> float:
    """Return the greatest indentation that is not stray, of those that are finite; 0 without any."""
    finite = indentation[np.isfinite(indentation)]
    if len(finite) == 0:
        return 0.0
    last = len(finite) - 1 - min(MOST_STRAY, int(STRAY * len(finite)))
    return float(np.partition(finite, last)[last])


def sensor_frame(axes: Axis, face: float) -> Float64[np.ndarray, "4 4"]:
    """Return the rigid pose of pcsr's frame of the sensor in the frame of the messages, in mm.

    Args:
        axes: axis of the messages' frame along which the sensor looks.
        face: distance along that axis from the frame's origin to the gel's face, in mm.
    """
    pose: Float64[np.ndarray, "4 4"] = rotation_from(axes) @ offset_z(-face)
    return pose
