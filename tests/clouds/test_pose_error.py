"""Errors of poses: standard deviations within bounds."""

import pytest

from pcsr import PoseError, UserError


@pytest.mark.parametrize(
    ("position", "rotation", "said"),
    [
        (-0.1, 0.0, "position is -0.1 mm: it must be 0 to 100"),
        (101.0, 0.0, "position is 101 mm"),
        (float("nan"), 0.0, "position is nan mm"),
        (1.0, 46.0, "rotation is 46 degrees: it must be 0 to 45"),
        (1.0, float("inf"), "rotation is inf degrees"),
    ],
)
def test_impossible_errors_are_refused(position, rotation, said):
    with pytest.raises(UserError, match=said):
        PoseError(position, rotation)


def test_only_two_zeros_are_exact():
    assert PoseError(0.0, 0.0).exact
    assert not any(error.exact for error in (PoseError(), PoseError(0.0, 1.0), PoseError(1.0, 0.0)))
