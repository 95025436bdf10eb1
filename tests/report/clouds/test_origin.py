"""Old points are those of the cloud before, whatever digits a file format keeps."""

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds.origin import in_both, with_origin

RNG = np.random.default_rng(0)
OLD, NEW = RNG.uniform(size=(50, 3)), RNG.uniform(size=(90, 3))


def slow_in_both(points, old):
    return np.array([any((point == other).all() for other in old) for point in points])


def test_points_that_are_equal_are_old():
    mixed = RNG.permutation(np.vstack([OLD, NEW]))
    np.testing.assert_array_equal(in_both(mixed, OLD), slow_in_both(mixed, OLD))
    assert in_both(mixed, OLD).sum() == 50


@pytest.mark.parametrize("shift", [0.0, 1000.0, -450_000.0])
@pytest.mark.parametrize("kind", ["single", "seven digits after the point"])
def test_digits_that_a_format_drops_make_no_point_new(shift, kind):
    old, new = OLD + shift, NEW + shift
    if kind == "single":
        old, new = (cloud.astype(np.float32).astype(np.float64) for cloud in (old, new))
        before = OLD + shift
    else:
        before = np.round(old, 7)
    known = in_both(np.vstack([old, new]), before)
    assert known[:50].all()
    if shift > -1e5 or kind != "single":  # otherwise single precision is as coarse as the cloud is dense
        assert not known[50:].any()


def test_the_column_source_is_made_anew_but_touched_points_stay_so():
    cloud = Cloud(np.vstack([OLD, NEW]), {"source": np.r_[np.full(60, 2), np.zeros(80)].astype(np.uint8)})
    marked, count = with_origin(cloud, Cloud(OLD))
    assert count == 50
    assert marked.columns["source"].tolist() == [0] * 50 + [2] * 10 + [1] * 80
    assert cloud.columns["source"][0] == 2, "the cloud that was given stays as it is"


def test_another_cloud_has_no_old_points():
    marked, count = with_origin(Cloud(1000 * NEW), Cloud(OLD))
    assert count == 0
    assert set(marked.columns["source"]) == {1}
