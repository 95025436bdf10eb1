"""`pcsr sensor calibrate` with real presses of a GelSight Mini and a DIGIT, whose balls are known."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.sensors import Calibration
from tests.cli.test_sensor import rows

PRESSES = Path(__file__).parents[3] / "shared" / "data" / "tactile"
MINI, DIGIT = PRESSES / "gelsight-mini", PRESSES / "digit"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (MINI / "background.png").exists(), reason="the images of real presses are not here"),
]


def calibrate(out, *words):
    done = CliRunner().invoke(pcsr, ["sensor", "calibrate", *map(str, words), "-o", str(out)])
    assert done.exit_code == 0, done.output
    return done


def mini(out, *words):
    given = ("--ball", 6.31, "--mm-per-pixel", 0.0634, "--sensor", "gelsight-mini")
    return calibrate(out, MINI / "6.310mm", *given, "--background", MINI / "background.png", *words)


def test_twelve_presses_calibrate_a_gelsight_mini(tmp_path):
    done = mini(tmp_path / "mini.json", "--presses", 12, "--page", tmp_path / "mini.html")
    figures = Calibration.load(tmp_path / "mini.json").figures
    assert figures.presses > 20
    assert figures.radius_median < 0.03
    assert figures.radius_90 < 0.08
    assert figures.shape < 0.012
    assert abs(figures.cap - 1) < 0.04
    assert rows(done.stdout)["6.31"][0] == str(figures.presses)
    assert done.stderr.count("is refused: the ball is cut off by the edge of the image") == 8
    assert (tmp_path / "mini.html").stat().st_size < 1e6


def test_the_calibration_holds_for_a_ball_of_another_diameter(tmp_path):
    test = ("--test", MINI / "9.500mm", "--test-ball", 9.5)
    found = rows(mini(tmp_path / "mini.json", *test).stdout)
    assert list(found) == ["9.5"]
    assert float(found["9.5"][4]) < 0.035


def test_thirteen_presses_calibrate_a_digit(tmp_path):
    given = ("--ball", 4.7, "--mm-per-pixel", 0.051, "--sensor", "digit", "--presses", 13)
    calibrate(tmp_path / "digit.json", DIGIT / "presses", *given, "--background", DIGIT / "background.png")
    figures = Calibration.load(tmp_path / "digit.json").figures
    assert figures.presses == 14
    assert figures.radius_median < 0.03
    assert figures.radius_90 < 0.12
