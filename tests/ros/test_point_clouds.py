"""PointCloud2: any layout and byte order, and messages that contradict themselves."""

from types import SimpleNamespace

import numpy as np
import pytest

from pcsr import UserError
from pcsr.ros.bag import Bag
from pcsr.ros.point_clouds import coordinates, table

POINTS = np.random.default_rng(0).normal(size=(12, 3)).astype("f4").astype("f8")


@pytest.mark.parametrize("kind", ["f4", "f8"])
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize(("rows", "pad"), [(1, 0), (1, 5), (3, 0), (4, 7)])
def test_points_and_fields_of_any_layout(bag, kind, big, rows, pad):
    rings = np.arange(12, dtype="u2")
    with bag:
        bag.cloud("/points", 0.0, POINTS, kind=kind, big=big, rows=rows, pad=pad, ring=rings)
    with Bag([bag.path]) as opened:
        found = table(opened.last("/points").content)
    np.testing.assert_array_equal(coordinates(found), POINTS)
    np.testing.assert_array_equal(found["ring"], rings)


def message(**changed):
    fields = [SimpleNamespace(name=axis, offset=4 * i, datatype=7, count=1) for i, axis in enumerate("xyz")]
    data = POINTS.astype("<f4").view(np.uint8).reshape(-1)
    whole = {"height": 1, "width": 12, "fields": fields, "is_bigendian": False, "point_step": 12, "row_step": 144}
    return SimpleNamespace(**whole | {"data": data} | changed)


def field(name="x", offset=0, datatype=7, count=1):
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


def test_harmless_deviations_are_read():
    np.testing.assert_array_equal(coordinates(table(message())), POINTS)
    np.testing.assert_array_equal(coordinates(table(message(row_step=0))), POINTS)
    for one in (message(width=0), message(height=0), message(height=0, data=np.zeros(0, np.uint8))):
        assert coordinates(table(one)).shape == (0, 3)
    again = [*message().fields, field("x", 4), field("", 0)]
    np.testing.assert_array_equal(coordinates(table(message(fields=again))), POINTS)
    uncounted = [field(axis, 4 * i, count=0) for i, axis in enumerate("xyz")]
    np.testing.assert_array_equal(coordinates(table(message(fields=uncounted))), POINTS)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"width": 13}, "it claims 1 rows of 13 points, of 12 bytes each .* and has 144 bytes: it is damaged"),
        ({"width": 2**32 - 1, "height": 2**32 - 1, "row_step": 2**32 - 1}, "it claims 4294967295 rows"),
        ({"height": 2**32 - 1, "row_step": 0}, "it claims"),
        ({"height": 2, "width": 6, "row_step": 71}, "it claims 2 rows of 6 points"),
        ({"point_step": 0}, r"its field 'x', 1 numbers from byte 0 on, does not fit into its points of 0 bytes"),
        ({"width": 0, "point_step": 2**32 - 1}, "its points have 4294967295 bytes each, and 32768 are the most"),
        ({"fields": [field(offset=9)]}, "does not fit into its points of 12 bytes"),
        ({"fields": [field(count=2**31)]}, "does not fit"),
        ({"fields": [field(datatype=9)]}, "its field 'x' has the type 9, which no PointCloud2 has"),
        ({"fields": [field("x"), field("y", 4)]}, r"it needs the fields x, y and z, .* and has x \(float32\), y"),
        ({"fields": []}, "and has none"),
        ({"fields": [field(axis, 4 * i, datatype=5) for i, axis in enumerate("xyz")]}, r"x \(int32\)"),
    ],
)
def test_messages_that_contradict_themselves_are_refused(changed, said):
    with pytest.raises(UserError, match=said):
        coordinates(table(message(**changed)))
