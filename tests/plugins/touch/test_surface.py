"""`surface`: points of the whole surface, in the place of touches."""

import numpy as np
import pytest
import trimesh

from pcsr import ShapeItem, UserError
from pcsr_plugins.touch.surface import Surface

BOX = ShapeItem("box", "box", trimesh.creation.box([2.0, 2.0, 2.0]))
CLOUD = np.zeros((1, 3))


def test_each_touch_is_a_sample_of_the_whole_surface_by_area():
    first, second = Surface(points=6000, unit=25.4).touches(BOX, CLOUD, 2, seed=3)
    for touch in (first, second):
        assert touch.points.shape == (6000, 3)
        assert (touch.unit, touch.sensor, touch.contact_area, len(touch.poses)) == (25.4, "surface", None, 0)
        np.testing.assert_allclose(np.abs(touch.points).max(1), 1.0)
        side = 2 * np.abs(touch.points).argmax(1) + (touch.points.sum(1) > 0)
        assert np.bincount(np.abs(touch.points).argmax(1)).min() > 1800
        assert len(np.unique(side)) == 6
    assert not np.isin(first.points, second.points).all(1).any()


def test_the_seed_decides():
    source = Surface(points=5)
    assert np.array_equal(source.touches(BOX, CLOUD, 1, 0)[0].points, source.touches(BOX, CLOUD, 3, 0)[0].points)
    assert not np.array_equal(source.touches(BOX, CLOUD, 1, 0)[0].points, source.touches(BOX, CLOUD, 1, 1)[0].points)


def test_what_has_no_surface_is_refused():
    flat = ShapeItem("flat", "flat", trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False))
    with pytest.raises(UserError, match="1 triangles of area 0 in all"):
        Surface().touches(flat, CLOUD, 1, 0)
