"""Images in colour of a camera-based tactile sensor: messages sensor_msgs/Image and CompressedImage."""

from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import UInt8

from pcsr.recorded.bags.pressed import Pressed, TactileTopic, greatest
from pcsr.ros import images
from pcsr.sensors.calibration import Calibration
from pcsr.sensors.contact import NoContactError


@dataclass(frozen=True)
class ColourTopic(TactileTopic):
    """Reader of images in colour."""

    calibration: Calibration
    calibration_file: bytes
    """Content of the calibration's file."""
    background: UInt8[np.ndarray, "h w 3"]
    """Image of the untouched gel."""

    def indentation(self, content: Any) -> float:
        """Return the greatest indentation of the gel in a message, in mm, without stray pixels; 0 without any."""
        image = images.colours(content)
        try:
            reading = self.calibration.read(image, self.background)
        except NoContactError:
            return 0.0
        return greatest(reading.indentation[reading.contact])

    def pressed(self, content: Any, name: str) -> Pressed:
        """Return the contact in a message, as the calibration finds it."""
        image = images.colours(content)
        reading = self.calibration.read(image, self.background)
        depth = greatest(reading.indentation[reading.contact])
        return Pressed(reading.points, depth, reading.area, {"image": f"{name}.png"}, {f"{name}.png": _png(image)})

    @property
    def sensor(self) -> str | None:
        """Name of the sensor that was calibrated."""
        return self.calibration.sensor

    def shared(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Return the background and the calibration."""
        keys = {"background": "background.png", "calibration": "calibration.json"}
        return keys, {"background.png": _png(self.background), "calibration.json": self.calibration_file}


def _png(image: UInt8[np.ndarray, "h w 3"]) -> bytes:
    from PIL import Image

    content = BytesIO()
    Image.fromarray(image).save(content, "PNG")
    return content.getvalue()
