"""Contact clouds of a tactile sensor: messages sensor_msgs/PointCloud2 in metres."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from pcsr.errors import UserError
from pcsr.recorded.bags.pressed import METRE, Pressed, TactileTopic, greatest, sensor_frame
from pcsr.recorded.fields import Axis
from pcsr.recorded.likely_mistakes import THICKEST
from pcsr.recorded.pose import transformed
from pcsr.ros.point_clouds import coordinates, table
from pcsr.sensors.gels import WIDEST

MOST_SHALLOWEST = 5.0
"""Greatest depth of a contact's shallowest point in mm: most gels are 2 to 5 mm thick."""
AT_FACE = 0.1
"""Share of the greatest indentation below which a point counts as untouched."""


@dataclass(frozen=True)
class CloudTopic(TactileTopic):
    """Reader of contact clouds."""

    axes: Axis
    """Axis of the messages' frame along which the sensor looks."""
    face: float
    """Distance in mm, along that axis, from the frame's origin to the gel's face."""
    above: float | None
    """Points that are not deeper than this, in mm, are left out; None to keep all."""

    def indentation(self, content: Any) -> float:
        """Return the greatest indentation of the gel in a message, in mm, without stray points; 0 without any."""
        return greatest(self._points(content)[:, 2])

    def pressed(self, content: Any, name: str) -> Pressed:
        """Return the contact in a message: its points, or those that are deep enough."""
        points = self._points(content)
        points = points if self.above is None else points[points[:, 2] > self.above]
        if len(points) == 0:
            raise UserError(
                f"no contact: no point {'is there' if self.above is None else f'is {self.above:g} mm deep'}"
            )
        low, high = float(points[:, 2].min()), float(points[:, 2].max())
        if high > THICKEST or low > MOST_SHALLOWEST:
            raise UserError(
                f"its points are {low:.3g} to {high:.3g} mm deep in the gel, more than any gel is thick: check --axes "
                f"and --face, and that the cloud is in metres"
            )
        width = float(np.abs(points[:, :2]).max())
        if width > WIDEST:
            raise UserError(
                f"its points lie up to {width:.4g} mm beside the axis of the sensor, and no gel is wider than "
                f"{WIDEST:g} mm: check --pose and --axes, and that the cloud is in the frame of the sensor"
            )
        return Pressed(points, greatest(points[:, 2]))

    def is_whole_gel(self, content: Any) -> bool:
        """Return whether most points of a message lie at the gel's face, as if it were a cloud of the whole gel."""
        depths = self._points(content)[:, 2]
        return self.above is None and len(depths) > 0 and bool(np.median(depths) < AT_FACE * greatest(depths))

    def _points(self, content: Any) -> Float64[np.ndarray, "n 3"]:
        """Return the points in pcsr's frame of the sensor, in mm, without those that are not finite."""
        points = METRE * coordinates(table(content))
        points = points[np.isfinite(points).all(axis=1)]
        return transformed(np.linalg.inv(sensor_frame(self.axes, self.face)), points)
