"""benchmarks/hidden_touches.py: errors of touches of the seen and of the hidden side, reported and registered."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from tests.registration import by_hand

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script = importlib.import_module("hidden_touches")


def test_errors_are_distances_in_mm_from_where_the_touches_should_be():
    unit = 1000.0
    exact = by_hand.touches(unit)
    reported = [by_hand.moved(one, by_hand.motion(0, [0, 0, -0.4], unit)) for one in exact]
    found = script.off(script.Case(by_hand.scan(), exact, reported), by_hand.registration(reported))
    np.testing.assert_allclose(found[:, 0], 0.4, atol=1e-9)
    np.testing.assert_allclose(found[:2, 1], [0.4, 0.0], atol=1e-9)
    np.testing.assert_allclose(found[:, 2], [1, 1, 0])


def test_two_touches_of_each_side_are_taken_or_none():
    cloud = np.random.default_rng(0).uniform(-20, 20, (500, 3)) * [1, 1, 0]
    at = [0, 15, 0.1, 1, 14, 0.2]
    touches = [pcsr.Touch.single(np.array([[0.0, 0, height]] * 5), None, 1.0, "digit") for height in at]
    assert script._rows(cloud, touches) == [0, 2, 1, 4]
    assert script._rows(cloud, touches[:4]) == []


@pytest.mark.slow
def test_both_sides_are_printed():
    done = CliRunner().invoke(script.main, ["--parts", "4", "--draws", "1"])
    assert done.exit_code == 0, done.output
    rows = [line.split("|")[1].split() for line in done.stdout.splitlines() if line.startswith("|")][2:]
    assert [row[1] for row in rows] == ["seen", "hidden"]
    assert rows[0][0] == rows[1][0]
