"""Far side of an object: points of the guessed surface, as a finger would meet it from behind."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from pcsr.exploration.far_side.image import HALF, PITCH, PIXELS, ViewFrame, image, pixel_centres
from pcsr.exploration.far_side.network import fitted_network
from pcsr.threads import threads

LIKELY = 0.5
"""Smallest probability with which the line of sight of a pixel meets the object."""
STEEP = 0.35
"""Smallest cosine between the normal and the line of sight: steeper surface has uncertain depths."""


@dataclass(frozen=True)
class FarSide:
    """Points of the guessed far side, one for each pixel that shows it."""

    points: Float[np.ndarray, "p 3"]
    normals: Float[np.ndarray, "p 3"]
    """Unit normals that point away from the object."""
    areas: Float[np.ndarray, " p"]
    """Area of the surface in each pixel."""
    errors: Float[np.ndarray, " p"]
    """Expected absolute error of the depth of each point."""


@threads(1)
def far_side(
    seen: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"], towards: Float[np.ndarray, "3"]
) -> FarSide:
    """Guess the far side of an object.

    Args:
        seen: points of the cloud, at least four.
        touched: touched points, in the frame and unit of `seen`.
        towards: unit vector towards the camera.

    Returns:
        The far side, in the frame and unit of `seen`.
    """
    frame = ViewFrame.of(seen, towards)
    images = torch.from_numpy(image(frame.local(seen), frame.local(touched)))[None]
    with torch.no_grad():
        occupied, depth, error = (one[0].double().numpy() for one in fitted_network()(images))
    rows, columns = np.gradient(depth, PITCH)
    normals = np.stack([columns, rows, -np.ones_like(depth)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    likely = occupied > np.log(LIKELY / (1 - LIKELY))
    inner = likely & (-normals[..., 2] > STEEP)
    for axis in (0, 1):  # at the outline the differences of depths are no slopes
        for step in (1, -1):
            inner &= np.roll(likely, step, axis)
    inner &= np.abs(pixel_centres().reshape(PIXELS, PIXELS, 2)).max(-1) < HALF - PITCH
    kept = inner.ravel()
    points = np.column_stack([pixel_centres(), depth.ravel()])[kept]
    cosines = -normals.reshape(-1, 3)[kept, 2]
    return FarSide(
        frame.back(points),
        normals.reshape(-1, 3)[kept] @ frame.axes.T,
        (PITCH * frame.scale) ** 2 / cosines,
        np.exp(error.ravel()[kept]) * frame.scale,
    )
