"""Synthetic images of a gel, to try calibration and reading without a sensor.

A gel with a matt (Lambertian) surface is lit by a red, a green and a blue light from three sides. Its membrane takes
the shape of a ball within the contact, and sinks in around it.
"""

import numpy as np
from jaxtyping import Float

from pcsr.sensors.contact import CONTACT_SHARE
from pcsr.sensors.images import Image

ELEVATION = np.radians(35.0)
"""Angle of the lights above the gel."""
AZIMUTHS = np.radians([90.0, 210.0, 330.0])
"""Directions that the red, the green and the blue light come from."""
FADING = 0.35
"""Part of a light's brightness that is lost from one end of the gel to the other."""
BRIGHT = 110.0
"""Level of each colour in the middle of the untouched gel."""
NOISE = 1.0
"""Standard deviation of the camera's noise in levels."""


def ball_indentation(
    size: tuple[int, int], mm_per_pixel: float, diameter: float, depth: float, centre: tuple[float, float]
) -> Float[np.ndarray, "rows columns"]:
    """Return the indentation of a gel into which a ball is pressed, in millimetres.

    Args:
        size: rows and columns of the image.
        mm_per_pixel: side of a pixel.
        diameter: diameter of the ball in millimetres.
        depth: greatest indentation in millimetres.
        centre: column and row of the ball's centre.

    Examples:
        >>> from pcsr.sensors import ball_indentation
        >>> print(f"{ball_indentation((60, 80), 0.1, 6.0, 0.5, (40.0, 30.0)).max():.2f} mm")
        0.50 mm
    """
    rows, columns = np.mgrid[: size[0], : size[1]]
    distance = np.hypot(columns - centre[0], rows - centre[1]) * mm_per_pixel
    radius = diameter / 2
    cap = (1 - CONTACT_SHARE) * depth
    rim = np.sqrt(radius**2 - (radius - cap) ** 2)
    steepest = rim / (radius - cap)
    ball = np.sqrt(np.maximum(radius**2 - distance**2, 0)) - (radius - depth)
    around = (depth - cap) * np.exp(-np.maximum(distance - rim, 0) * steepest / (depth - cap))
    indentation: Float[np.ndarray, "rows columns"] = np.where(distance < rim, ball, around)
    return indentation


def shaded(
    indentation: Float[np.ndarray, "rows columns"], mm_per_pixel: float, rng: np.random.Generator | None = None
) -> Image:
    """Render the image that a camera behind a gel takes.

    Args:
        indentation: indentation of the gel at each pixel in millimetres; 0 everywhere for a background.
        mm_per_pixel: side of a pixel.
        rng: source of the camera's noise; None for an image without noise.

    Examples:
        >>> from pcsr.sensors import shaded
        >>> shaded(np.zeros((60, 80)), 0.1).shape
        (60, 80, 3)
    """
    down, right = np.gradient(indentation, mm_per_pixel)
    length = np.sqrt(1 + right**2 + down**2)
    rows, columns = indentation.shape
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    image = np.zeros((rows, columns, 3))
    for colour, azimuth in enumerate(AZIMUTHS):
        towards = np.cos(azimuth), -np.sin(azimuth)  # rows are counted downwards
        lit = np.sin(ELEVATION) + np.cos(ELEVATION) * (right * towards[0] + down * towards[1])
        near = 1 + FADING / 2 * (x * towards[0] + y * towards[1])
        image[..., colour] = BRIGHT * near * np.maximum(lit / length, 0) / np.sin(ELEVATION)
    if rng is not None:
        image += rng.normal(0, NOISE, image.shape)
    return np.clip(image, 0, 255).round().astype(np.uint8)
