"""Calibration of a tactile sensor with 12 presses, and reading of an image. Asked for: 10 s, and 25 ms an image.

make bench ARGS="benchmarks/test_sensors.py --save=sensor-images"
"""

import numpy as np
import pytest
from scipy import fft

from pcsr.sensors import PressImage, ball_indentation, calibrate, gel, shaded

SIZE, PITCH = (240, 320), 0.0634
PRESSES = 12


def image(depth, centre, seed):
    indentation = ball_indentation(SIZE, PITCH, 6.31, depth, centre)
    return shaded(indentation, PITCH, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def background():
    return shaded(np.zeros(SIZE), PITCH, np.random.default_rng(1000))


@pytest.fixture(scope="module")
def presses():
    rng = np.random.default_rng(0)
    places = rng.uniform([0.6, 50, 50], [0.9, 270, 190], (PRESSES, 3))
    return [PressImage(str(n), image(depth, (x, y), n), 6.31) for n, (depth, x, y) in enumerate(places)]


def calibrated(presses, background):
    return calibrate(presses, background, mm_per_pixel=PITCH, sensor="gelsight-mini", gel=gel("gelsight-mini"))


def test_calibration(benchmark, line, presses, background):
    line(f"calibration, {PRESSES} presses of 320 × 240 pixels, with cross-validation", "ours", "≤ 10 s")
    made = benchmark(calibrated, presses, background)
    assert not made.refused


def test_reading(benchmark, line, presses, background):
    line("an image of 320 × 240 pixels", "ours", "≤ 25 ms")
    calibration = calibrated(presses, background).calibration
    reading = benchmark(calibration.read, presses[0].image, background)
    assert reading.contact.any()


def test_the_cosine_transforms_alone(benchmark, line):
    line("an image of 320 × 240 pixels", "limit")
    slopes = np.random.default_rng(0).normal(size=SIZE)
    benchmark(lambda: fft.idctn(fft.dctn(slopes)))
