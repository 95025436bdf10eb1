"""Which pixels of a gel may be touched at all: a quick look at the triangles, before rays are cast."""

import numpy as np
from jaxtyping import Bool, Float

from pcsr.geometry.rays import MeshRays
from pcsr_plugins.touch.digit.sensors import Sensor

FACES = 1
"""With more faces for each pixel, a look at all of them takes longer than the rays that it saves."""


def promising(
    sensor: Sensor, rays: MeshRays, point: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], lowest: float
) -> tuple[float, Bool[np.ndarray, " pixels"]]:
    """A bound on how high the object reaches below the gel, and which pixels may see it above `lowest`.

    Every triangle counts with the whole of its bounding box along the sensor's axes: the bound is never too low
    and no pixel is missing, but some may be too many.

    Args:
        sensor: its pixels.
        rays: the object.
        point: on the sensor's axis, in mm.
        frame: the sensor's axes as columns.
        lowest: height above the point along z, in mm.

    Returns:
        Height above the point in mm; the pixels row by row. Where a look would not pay, inf and all pixels.
    """
    columns, rows = sensor.pixels
    if rays.faces > FACES * columns * rows:
        return np.inf, np.ones(columns * rows, bool)
    low, high = rays.boxes(point, frame)
    # Embree finds triangles in float32: what it meets may lie a little beside them.
    margin, middle = 1e-5 * rays.reach, (np.array(sensor.pixels) - 1) / 2
    first = np.ceil((low[:, :2] - margin) / sensor.pitch + middle).clip(min=0)
    last = np.floor((high[:, :2] + margin) / sensor.pitch + middle).clip(max=2 * middle)
    over = (first <= last).all(1)
    bound = float(high[over, 2].max(initial=-np.inf)) + margin
    over &= high[:, 2] + margin > lowest
    left, top = first[over].astype(np.int64).T
    right, bottom = last[over].astype(np.int64).T + 1
    # Each box adds 1 to its pixels: its corners say where that begins and ends.
    boxes = np.zeros((rows + 1) * (columns + 1), np.int64)
    for row, column, sign in ((top, left, 1), (top, right, -1), (bottom, left, -1), (bottom, right, 1)):
        boxes += sign * np.bincount(row * (columns + 1) + column, minlength=len(boxes))
    return bound, (boxes.reshape(rows + 1, -1).cumsum(0).cumsum(1)[:-1, :-1] > 0).ravel()
