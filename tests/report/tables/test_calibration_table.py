"""Table of a calibration's errors: a row for each diameter, and one for all."""

from dataclasses import replace

import numpy as np

from pcsr.report.tables.calibration_table import HEADS, calibration_table, how_measured
from pcsr.sensors import Calibrated, PressFigures
from pcsr.sensors.fitting import Place
from tests.sensors.synthetic import calibrated


def made(*diameters, fits=0):
    held_out = [
        PressFigures(f"{k}.png", diameter, 1 + 0.02 * (k + 1), 0.004, 0.006, 0.95, 1.12, 0.7)
        for k, diameter in enumerate(diameters)
    ]
    return Calibrated(calibrated(), {"a": Place(np.zeros(2), 9.0, 0.05)}, held_out, fits, {})


def test_one_ball_is_one_row():
    table = calibration_table(made(6.31, 6.31))
    assert table.heads == HEADS
    assert table.cells == [["6.31", "2", "3.0", "3.8", "0.0040", "0.0060", "95.0", "5.0", "112"]]


def test_several_balls_are_a_row_each_and_one_for_all():
    table = calibration_table(made(9.5, 4.0, 9.5))
    assert [row[:3] for row in table.cells] == [["4", "1", "4.0"], ["9.5", "2", "4.0"], ["all", "3", "4.0"]]
    assert {len(row) for row in table.cells} == {len(HEADS)}


def test_the_title_says_how_the_errors_were_measured():
    assert how_measured(made(6.0, 6.0)) == "2 presses that are not used in the fit"
    assert how_measured(made(6.0, fits=10)) == (
        "1 presses by cross-validation, in 10 fits that each leave some of them out"
    )
    assert how_measured(made(6.0)) in calibration_table(made(6.0)).title
    assert replace(made(6.0), fits=3).fits == 3
