"""A synthetic sensor, its presses of a ball, and its calibration."""

from functools import cache

import numpy as np
from PIL import Image

from pcsr.sensors import Calibration, Gel, PressImage, ball_indentation, calibrate, shaded

SIZE = (120, 160)
"""Rows and columns of its images."""
PITCH = 0.12
"""Side of a pixel in mm."""
BALL = 6.0
"""Diameter of the pressed ball in mm."""


def photo(indentation, seed=0):
    return shaded(indentation, PITCH, np.random.default_rng(seed))


def background(seed=1000):
    return photo(np.zeros(SIZE), seed)


def ball(depth=0.7, centre=(80.0, 60.0), diameter=BALL):
    return ball_indentation(SIZE, PITCH, diameter, depth, centre)


def presses(count=12, seed=0, diameter=BALL):
    rng = np.random.default_rng(seed)
    places = [(rng.uniform(0.5, 0.9), (rng.uniform(30, 130), rng.uniform(30, 90))) for _ in range(count)]
    return [
        PressImage(f"{number}.png", photo(ball(depth, centre, diameter), seed * 100 + number), diameter)
        for number, (depth, centre) in enumerate(places)
    ]


@cache
def calibrated(dome=None) -> Calibration:
    return calibrate(presses(), background(), mm_per_pixel=PITCH, sensor="x", gel=Gel(dome)).calibration


def save(path, image):
    Image.fromarray(image).save(path)
    return path
