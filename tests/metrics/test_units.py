import warnings

import numpy as np
import pytest

from pcsr import PcsrWarning
from pcsr.metrics.units import warn_of_units

POINTS = np.random.default_rng(0).normal(size=(200, 3))


@pytest.mark.parametrize(
    ("factor", "shown"),
    [(1000, "1,000"), (10, "10"), (100, "100"), (25.4, "25.4"), (39.37, "39.4"), (1e6, "1,000,000"), (7, "7")],
)
def test_the_larger_one_and_the_ratio_are_named(factor, shown):
    for one, other in ((POINTS * factor, POINTS), (POINTS, POINTS * factor)):
        names = ("big", "small") if one is not POINTS else ("small", "big")
        with pytest.warns(PcsrWarning, match=rf"^big is {shown} times larger than small: are the units the same\?$"):
            warn_of_units(one + 5, names[0], other, names[1])


def test_a_sparse_part_and_a_stray_point_are_no_other_unit():
    stray = np.concatenate([POINTS, [[1e9, 0, 0]]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_units(POINTS[POINTS[:, 0] > 0], "a", POINTS, "b")
        warn_of_units(stray, "a", POINTS, "b")
        warn_of_units(POINTS * 3, "a", POINTS, "b")
        warn_of_units(np.zeros((4, 3)), "a", POINTS, "b")
