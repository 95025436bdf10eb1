"""Pictures of the depth of touches, as the sensor sees them."""

import io

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from pcsr.clouds.touch import Touch
from pcsr.report.colours import value_colours
from pcsr.report.recording.facts import in_sensors

LONGEST = 160
"""Most pixels along a side of a picture."""


def depth_pictures(touch: Touch) -> list[bytes]:
    """Return a PNG file for each finger of a touch that has points: depth as colour, transparent where nothing is.

    The picture shows the sensor's view, if it is known, else the points. Its colours go from a depth of 0, or the
    lowest one below it, to the greatest.

    Args:
        touch: the touch; without poses it has no pictures.
    """
    return [_picture(points, touch.view) for points in in_sensors(touch) if len(points)]


def _picture(points: Float[np.ndarray, "m 3"], view: tuple[float, float] | None) -> bytes:
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    spacing = float(np.sqrt(np.prod(high - low) / len(points)))
    if view is not None:
        low, high = np.minimum(low, -np.divide(view, 2)), np.maximum(high, np.divide(view, 2))
    side = max(float((high - low).max()) / LONGEST, spacing, 1e-9)
    columns, rows = (np.floor((high - low) / side) + 1).astype(int)
    across, down = np.floor((points[:, :2] - low) / side).astype(int).T
    depth = np.full((rows, columns), -np.inf)
    np.maximum.at(depth, (rows - 1 - down, across), points[:, 2])  # y points up
    file = io.BytesIO()
    Image.fromarray(_coloured(depth)).save(file, "PNG", optimize=True)
    return file.getvalue()


def _coloured(depth: Float[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 4"]:
    shown = np.isfinite(depth)
    low, high = min(float(depth[shown].min()), 0.0), float(depth[shown].max())
    share = (np.where(shown, depth, low) - low) / ((high - low) or 1.0)
    return np.dstack([value_colours(share), np.where(shown, 255, 0).astype(np.uint8)])
