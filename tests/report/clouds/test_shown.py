"""What is shown of clouds, and what is said of the rest."""

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds import shown
from pcsr.report.clouds.shown import Named, rows_of, scene

RNG = np.random.default_rng(0)
POINTS = RNG.uniform(size=(500, 3))


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(shown, "MOST_EACH", 200)
    monkeypatch.setattr(shown, "MOST", 300)
    monkeypatch.setattr(shown, "MOST_TOUCHED", 20)


def test_a_small_cloud_is_shown_whole():
    seen = scene([Named("a", Cloud(POINTS, {"heat": POINTS[:, 0]}))], "heat")
    (one,) = seen.clouds
    np.testing.assert_array_equal(one.points, POINTS)
    np.testing.assert_array_equal(one.colours, POINTS[:, 0])
    assert one.caption == "a, 500 points"
    assert seen.notes == []


def test_a_large_one_is_thinned_with_its_colours_and_that_is_said(few):
    cloud = Cloud(POINTS, {"heat": POINTS[:, 0]})
    (one,) = scene([Named("a", cloud)], "heat").clouds
    assert len(one.points) == 200
    assert len({tuple(point) for point in one.points} & {tuple(point) for point in POINTS}) == 200
    np.testing.assert_array_equal(one.colours, one.points[:, 0])
    assert one.caption == "a, 200 of 500 points"
    assert one.notes == ["a: shown: 200 of 500 points, drawn at random"]
    (again,) = scene([Named("a", cloud)], "heat").clouds
    np.testing.assert_array_equal(one.points, again.points)
    (other,) = scene([Named("a", cloud)], "heat", seed=1).clouds
    assert not np.array_equal(one.points, other.points)


def test_the_points_that_are_shown_are_spread_over_the_file(few):
    positions = scene([Named("a", Cloud(np.arange(1500.0).reshape(500, 3)))]).clouds[0].points[:, 0] / 1500
    assert abs(positions.mean() - 0.5) < 0.1
    assert (np.diff(positions) > 0).all()


def test_many_clouds_share_the_points_that_may_be_shown(few):
    seen = scene([Named(str(k), Cloud(POINTS)) for k in range(3)])
    assert [len(one.points) for one in seen.clouds] == [100] * 3


def test_the_counts_are_those_of_the_whole_cloud(few):
    source = np.repeat([0, 1, 2], [100, 380, 20])
    (one,) = scene([Named("a", Cloud(POINTS, {"source": source}))]).clouds
    assert one.caption == "a, 200 of 500 points: 100 old, 380 new, 20 touched"


def test_points_far_away_are_left_out_and_counted():
    seen = scene([Named("a", Cloud(np.vstack([POINTS, [[1e10, 0, 0]]])))])
    (one,) = seen.clouds
    np.testing.assert_array_equal(one.points, POINTS)
    assert seen.notes == ["a: 1 point is far away and is not shown"]
    assert one.caption == "a, 500 of 501 points"
    assert one.high[0] == 1e10


def test_clouds_of_two_frames_are_said_to_be_so():
    (note,) = scene([Named("a", Cloud(POINTS)), Named("b", Cloud(POINTS * 1000))]).notes
    assert note.endswith("one frame: each fills its own view")


def test_touches_are_joined_and_thinned(few):
    touches = [RNG.uniform(size=(15, 3)).astype(np.float32), RNG.uniform(size=(15, 3))]
    assert len(scene([Named("a", Cloud(POINTS))], touches=touches).touched) == 20
    assert scene([Named("a", Cloud(POINTS))]).touched.shape == (0, 3)


def test_rows_of_classes_are_those_of_their_points():
    label = RNG.integers(0, 3, 500) * 10
    seen = scene([Named("a", Cloud(POINTS, {"label": label}))], "label")
    for text, _, rows in rows_of(seen.clouds[0], seen.colours.key):
        assert (label[rows] == int(text)).all()
        assert len(rows) == (label == int(text)).sum()
