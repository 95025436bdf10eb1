"""What is refused as no cloud, and as lying in another frame or unit."""

import numpy as np
import pytest

from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud, check_frame


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (np.zeros((0, 3)), "a.ply holds no points"),
        (np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 1]]), "a.ply: 2 of 3 points have a coordinate .* or --bad"),
        (np.full((5, 3), 0.1), "all 5 points of a.ply lie on one spot"),
    ],
)
def test_what_is_no_cloud_is_named(points, reason):
    with pytest.raises(UserError, match=reason):
        check_cloud(points, "a.ply", extent=True, remedy=", or --bad drop")


def test_one_spot_is_a_cloud_where_no_extent_is_needed():
    check_cloud(np.full((5, 3), 0.1))


@pytest.mark.parametrize(("distance", "size", "fits"), [(1.0, 4.0, True), (1.1, 4.0, False), (0.0, 4.1, False)])
def test_the_limits_are_in_extents_of_the_reference(distance, size, fits):
    limits = {"extent": 2.0, "most_distance": 0.5, "most_size": 2.0, "power": 3}
    if fits:
        check_frame("touch 3", "the cloud", distance=distance, size=size, **limits)
        return
    lengths = f"is {8 * size:.4g} across and lies {8 * distance:.4g} away from the cloud, which is 16 across"
    with pytest.raises(UserError, match=f"touch 3 {lengths}: it is in another unit or frame"):
        check_frame("touch 3", "the cloud", distance=distance, size=size, **limits)


@pytest.mark.parametrize("wrong", [{"distance": np.nan}, {"size": np.nan}, {"distance": np.inf}])
def test_what_is_not_finite_is_refused(wrong):
    with pytest.raises(UserError, match="in another unit or frame"):
        check_frame("it", "the cloud", **{"distance": 0.0, "size": 0.0} | wrong, extent=2.0, most_distance=0.5)
