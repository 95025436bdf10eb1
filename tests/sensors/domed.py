"""A synthetic sensor with a domed gel: its shading is that of its face, and an untouched face is no plane."""

from functools import cache

import numpy as np

from pcsr.sensors import Gel, PressImage, calibrate
from tests.sensors.synthetic import BALL, PITCH, SIZE, photo

GEL = Gel((50.0, 23.0))
ROWS, COLUMNS = np.mgrid[: SIZE[0], : SIZE[1]]
X, Y = (COLUMNS - 79.5) * PITCH, (59.5 - ROWS) * PITCH
SAG = X**2 / (2 * 50.0) + Y**2 / (2 * 23.0)


def touched(surface, seed=0):
    """The image of a gel that an object with this surface, in the sensor's frame, is pressed into."""
    return photo(np.maximum(surface, -SAG), seed)


def background():
    return photo(-SAG, 99)


def pressed_ball(depth, centre, seed):
    away = np.hypot(COLUMNS - centre[0], ROWS - centre[1]) * PITCH
    x, y = (centre[0] - 79.5) * PITCH, (59.5 - centre[1]) * PITCH
    top = depth - x**2 / (2 * 50.0) - y**2 / (2 * 23.0)
    surface = top - BALL / 2 + np.sqrt(np.maximum((BALL / 2) ** 2 - away**2, 0))
    return PressImage(f"{seed}.png", touched(np.where(away < BALL / 2, surface, -9), seed), BALL)


def presses(count=14):
    rng = np.random.default_rng(0)
    return [
        pressed_ball(rng.uniform(0.5, 0.9), (rng.uniform(30, 130), rng.uniform(30, 90)), number)
        for number in range(count)
    ]


@cache
def calibrated(gel):
    """The sensor, calibrated as one of a gel that may be another than its own."""
    return calibrate(presses(), background(), mm_per_pixel=PITCH, sensor="domed", gel=gel).calibration


def plate(height, x=0.0, y=0.0):
    """The surface of a flat plate of radius 3 mm with bevelled edges."""
    return np.minimum(height, height - 0.8 * (np.hypot(X - x, Y - y) - 3))
