"""Depth images of a camera behind a gel: messages sensor_msgs/Image."""

from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import Float64

from pcsr.recorded.bags.pressed import Pressed, TactileTopic, greatest
from pcsr.recorded.gel_images import touching
from pcsr.recorded.images import depth_contact, same_size
from pcsr.recorded.manifest import Intrinsics
from pcsr.ros import images


@dataclass(frozen=True)
class DepthTopic(TactileTopic):
    """Reader of depth images."""

    intrinsics: Intrinsics
    face: float
    """Distance from the camera to the gel's face in mm."""
    above: float | None
    """Indentation in mm above which a pixel is in contact; None to find the contact by `touching`."""
    background: Float64[np.ndarray, "h w"] | None = None
    """Depths of the untouched gel in mm, NaN where there is none; None for a flat gel at `face`."""

    def indentation(self, content: Any) -> float:
        """Return the greatest indentation of the gel in a message, in mm, without stray pixels; 0 without any."""
        return greatest(self._indentation(images.depth(content)))

    def pressed(self, content: Any, name: str) -> Pressed:
        """Return the contact in a message: the pixels that are deep enough."""
        depths = images.depth(content)
        indentation = self._indentation(depths)
        contact = touching(indentation, self.above)
        points, area = depth_contact(depths, self.intrinsics, self.face, contact)
        entry: dict[str, Any] = {
            "depth": f"{name}.npy",
            "unit": "mm",
            "intrinsics": self.intrinsics.model_dump(),
            "face": self.face,
        }
        if self.above is not None:
            entry["contact_above"] = self.above
        if self.background is not None:
            entry["background"] = "background.npy"
        return Pressed(points, greatest(indentation[contact]), area, entry, {f"{name}.npy": _npy(depths)})

    def shared(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Return the file of the background."""
        return {}, {} if self.background is None else {"background.npy": _npy(self.background)}

    def _indentation(self, depths: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "h w"]:
        if self.background is None:
            return self.face - depths
        same_size(depths, self.background, "background")
        indentation: Float64[np.ndarray, "h w"] = self.background - depths
        return indentation


def _npy(depths: Float64[np.ndarray, "h w"]) -> bytes:
    content = BytesIO()
    np.save(content, depths, allow_pickle=False)
    return content.getvalue()
