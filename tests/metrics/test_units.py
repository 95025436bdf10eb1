import warnings

import numpy as np
import pytest

from pcsr import PcsrWarning
from pcsr.metrics.units import warn_of_units

POINTS = np.random.default_rng(0).normal(size=(200, 3))


@pytest.mark.parametrize(
    ("factor", "shown"),
    [
        (1000, "1,000"),
        (950, "1,000"),
        (3.28, "3.28"),
        (25.4, "25.4"),
        (39.37, "39.4"),
        (1e6, "1,000,000"),
        (1e9, r"1.0e\+09"),
    ],
)
def test_the_larger_one_and_the_ratio_are_named(factor, shown):
    for one, other in ((POINTS * factor, POINTS), (POINTS, POINTS * factor)):
        names = ("big", "small") if one is not POINTS else ("small", "big")
        with pytest.warns(PcsrWarning, match=rf"^big is {shown} times as large as small: if .* differ, convert one$"):
            warn_of_units(one + 5, names[0], other, names[1])


def test_a_sparse_part_and_a_stray_point_are_no_other_unit():
    stray = np.concatenate([POINTS, [[1e9, 0, 0]]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_units(POINTS[POINTS[:, 0] > 0], "a", POINTS, "b")
        warn_of_units(stray, "a", POINTS, "b")
        warn_of_units(POINTS * 2.9, "a", POINTS, "b")
        warn_of_units(np.zeros((4, 3)), "a", POINTS, "b")


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_sizes_neither_overflow_nor_vanish(scale):
    with pytest.warns(PcsrWarning, match="big is 10 times as large as small"):
        warn_of_units(POINTS * scale, "small", POINTS * scale * 10, "big")


def test_points_of_which_most_are_one_have_a_size():
    spot = np.concatenate([np.zeros((60, 3)), POINTS[:5]])
    with pytest.warns(PcsrWarning, match="big is 100 times as large as small"):
        warn_of_units(spot * 100, "big", spot, "small")
