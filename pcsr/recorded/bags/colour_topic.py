"""Images in colour of a camera-based tactile sensor: messages sensor_msgs/Image and CompressedImage."""

from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

from pcsr.errors import UserError
from pcsr.recorded.bags.pressed import Pressed, TactileTopic, greatest
from pcsr.ros import images

if TYPE_CHECKING:
    from pcsr.sensors import Calibration


@dataclass(frozen=True)
class ColourTopic(TactileTopic):
    """Reader of images in colour."""

    calibration: "Calibration"
    calibration_file: bytes
    """Content of the calibration's file."""
    background: UInt8[np.ndarray, "h w 3"]
    """Image of the untouched gel."""

    def indentation(self, content: Any) -> float:
        """Return the greatest indentation of the gel in a message, in mm, without stray pixels; 0 without any."""
        return greatest(self.calibration.read(images.colours(content), self.background).indentation)

    def pressed(self, content: Any, name: str) -> Pressed:
        """Return the contact in a message, as the calibration finds it."""
        image = images.colours(content)
        reading = self.calibration.read(image, self.background)
        if len(reading.points) == 0:
            raise UserError("no contact: no pixel is in contact")
        return Pressed(reading.points, reading.area, {"image": f"{name}.png"}, {f"{name}.png": _png(image)})

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
