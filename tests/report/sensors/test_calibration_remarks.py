"""What is said about a calibration that is odd."""

from dataclasses import replace

import numpy as np
import pytest

from pcsr.report.sensors.calibration_remarks import calibration_remarks
from pcsr.sensors import Calibrated, Place
from tests.sensors.synthetic import SIZE, calibrated


def made(spread=(0.8, 0.8), **figures):
    ends = np.array(spread) * SIZE[::-1]
    places = {f"{share}": Place(10 + share * ends, 20.0, 0.01) for share in (0.0, 0.3, 1.0)}
    calibration = replace(calibrated(), figures=replace(calibrated().figures, **figures))
    return Calibrated(calibration, places, [], 0, {})


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        ({"radius_median": 0.11}, "the errors are large"),
        ({"cap_spread": 0.21}, "the errors are large"),
        ({"spread": (0.29, 0.8)}, "the balls lie within 29% of the image's width"),
        ({"spread": (0.8, 0.05)}, "the balls lie within 5% of the image's height"),
    ],
)
def test_one_line_for_each_thing_that_is_odd(odd, said):
    assert calibration_remarks(made()) == []
    (line,) = calibration_remarks(made(**odd))
    assert line.startswith(said)
    assert len(calibration_remarks(made(spread=(0.1, 0.1), radius_median=1.0))) == 3
