"""Summary of the errors on held-out presses, and the expected errors of points."""

import numpy as np
import pytest

from pcsr.sensors import Figures, PressFigures
from pcsr.sensors.figures import UNSEEN, summary
from tests.sensors.synthetic import background, ball, calibrated, photo

RATIOS = (0.9, 1.02, 1.0, 1.01, 1.3)
PRESSES = [
    PressFigures(f"{k}.png", 6.0, ratio, 0.01 * k, 0.02 * k, 2 - ratio, 1 + 0.1 * k, 0.5)
    for k, ratio in enumerate(RATIOS)
]


def test_the_summary_has_medians_and_quantiles_of_sizes_of_errors():
    found = summary(PRESSES)
    assert found.presses == 5
    assert found.radius_median == pytest.approx(0.02)
    assert found.radius_90 == pytest.approx(0.1 + 0.6 * 0.2)
    assert (found.shape, found.ball, found.cap, found.area) == pytest.approx((0.02, 0.04, 0.99, 1.2))
    assert found.cap_spread == pytest.approx(np.sqrt((0.1**2 + 0.02**2 + 0.01**2 + 0.3**2) / 5))
    assert summary(PRESSES[::-1]) == found


def test_the_expected_error_grows_with_the_indentation_and_has_a_shared_part():
    figures = Figures(12, 0.03, 0.06, 0.006, 0.008, 0.99, 0.05, 1.1)
    errors = figures.errors(np.array([0.0, 0.4, 1.0]))
    assert errors[0] == pytest.approx(np.sqrt(0.008**2 + UNSEEN**2))
    assert errors[1] == pytest.approx(np.sqrt(0.008**2 + 0.02**2 + UNSEEN**2))
    assert (np.diff(errors) > 0).all()
    assert figures.errors(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize(("diameter", "depth"), [(6.0, 0.4), (6.0, 0.8), (20.0, 0.5), (40.0, 0.4)])
def test_true_errors_are_of_the_size_of_the_expected_ones(diameter, depth):
    indentation = ball(depth, diameter=diameter)
    reading = calibrated().read(photo(indentation, 7), background())
    true = (reading.indentation - indentation)[reading.contact]
    assert 0.2 < np.sqrt(np.mean((true / reading.errors) ** 2)) < 2.5
