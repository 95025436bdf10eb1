"""Touches are registered to the points of a sorted cloud near them, whatever interrupts the work."""

import numpy as np
import pytest

from pcsr import PcsrWarning, PoseError, Touch, UserError
from pcsr import touches as module
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import write_cloud
from pcsr.clouds.formats.chunks import open_chunks
from pcsr.streaming import job
from pcsr.streaming.filling import SortedCloud
from pcsr.streaming.registered import points_near
from pcsr.streaming.sorting import sort
from pcsr.streaming.work_folder import WorkFolder
from tests.registration import by_hand
from tests.streaming.clouds import stream

pytestmark = pytest.mark.filterwarnings("ignore:.*are added to it as unseen surface")


@pytest.fixture
def bowl(tmp_path):
    write_cloud(tmp_path / "bowl.npy", Cloud(by_hand.scan(1500)))
    return tmp_path / "bowl.npy"


@pytest.fixture
def sorted_bowl(bowl, tmp_path):
    work = WorkFolder(tmp_path / "sorted.npy")
    with work.opened({}):
        plan = sort(open_chunks(bowl), work, 300, "refuse", lambda done, total: None)
        yield SortedCloud(work, plan, [], {})


@pytest.mark.parametrize(("error", "margin"), [(PoseError(0.0, 0.0), 10.0), (PoseError(5.0, 0.0), 20.0)])
@pytest.mark.parametrize("unit", [1.0, 10.0])
def test_points_near_are_those_in_the_widened_boxes_in_the_order_of_the_file(sorted_bowl, error, margin, unit):
    touches = [Touch.single(one.points, None, unit, "digit") for one in by_hand.touches()]
    cloud = by_hand.scan(1500)
    near = np.zeros(len(cloud), bool)
    for touch in touches:
        gap = np.maximum(np.maximum(touch.points.min(0) - cloud, cloud - touch.points.max(0)), 0)
        near |= np.linalg.norm(gap, axis=1) <= margin / unit
    assert 30 < near.sum() < len(cloud)
    np.testing.assert_array_equal(points_near(sorted_bowl, touches, error), cloud[near])


def test_a_turned_pose_needs_a_wider_margin(sorted_bowl):
    narrow, wide = (points_near(sorted_bowl, by_hand.touches(), PoseError(0.0, degrees)) for degrees in (0.0, 10.0))
    assert len(wide) > len(narrow)


def test_of_too_many_points_a_random_part_is_used_and_always_the_same(sorted_bowl):
    every = points_near(sorted_bowl, by_hand.touches(), PoseError())
    some, again = (points_near(sorted_bowl, by_hand.touches(), PoseError(), most=100) for _ in range(2))
    np.testing.assert_array_equal(some, again)
    assert len(some) == 100
    row = {tuple(point): index for index, point in enumerate(every)}
    rows = [row[tuple(point)] for point in some]
    assert rows == sorted(rows)
    np.testing.assert_allclose(some.mean(0), every.mean(0), atol=8)


def test_where_no_point_is_near_those_of_the_nearest_tile_are_used(sorted_bowl):
    touch = Touch.single(by_hand.touches()[1].points + np.array([0, 0, 40]), None, 1.0, "digit")
    near = points_near(sorted_bowl, [touch], PoseError(0.0, 0.0))
    lower, upper = touch.points.min(0), touch.points.max(0)
    tiles = [sorted_bowl.own(tile).points for tile in sorted_bowl.plan.tiles]
    gaps = [np.maximum(np.maximum(tile.min(0) - upper, lower - tile.max(0)), 0) for tile in tiles]
    np.testing.assert_array_equal(near, tiles[np.argmin(np.linalg.norm(gaps, axis=1))])


@pytest.fixture
def made_by_hand(monkeypatch):
    clouds = []

    def register(given, cloud, *, pose_error=None):
        clouds.append(cloud)
        return by_hand.registration(given)

    monkeypatch.setattr(module, "register", register)
    return clouds


def test_registered_touches_are_used_and_refused_ones_are_named(bowl, tmp_path, made_by_hand):
    cloud, given = by_hand.scan(1500), by_hand.touches()
    hole = np.linalg.norm(cloud[:, :2] - given[1].points.mean(0)[:2], axis=1) < 9
    write_cloud(bowl, Cloud(cloud[~hole]))
    found = []
    registered = stream(bowl, tmp_path / "out.npy", 2, touches=given, registered=found.append)
    assert [one.verdict for one in found[0].touches] == ["kept", "moved", "refused"]
    used = [one.touch.points for one in found[0].touches[:2]]
    assert registered == stream(bowl, tmp_path / "arrays.npy", 2, touches=used)
    assert registered == stream(bowl, tmp_path / "records.npy", 2, touches=found[0])
    assert registered != stream(bowl, tmp_path / "as_is.npy", 2, touches=given, touch_as_is=True)
    assert len(made_by_hand) == 1
    with pytest.warns(PcsrWarning, match="1 of 3 touches are refused and not used: touch 2: it fits nowhere"):
        stream(bowl, tmp_path / "again.npy", touches=given)


def interrupted(monkeypatch, bowl, target, **options):
    def filled(self, *args):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(job.Job, "_filled", filled)
        with pytest.raises(KeyboardInterrupt):
            stream(bowl, target, **options)


def test_an_interrupted_command_registers_to_the_same_points_and_gives_the_same_bytes(
    bowl, tmp_path, monkeypatch, made_by_hand
):
    options = {"touches": by_hand.touches()[:2], "pose_error": PoseError(2.0, 1.0)}
    whole = stream(bowl, tmp_path / "whole.npy", **options)
    interrupted(monkeypatch, bowl, tmp_path / "out.npy", **options)
    assert stream(bowl, tmp_path / "out.npy", **options) == whole
    assert len(made_by_hand) == 3
    for cloud in made_by_hand[1:]:
        np.testing.assert_array_equal(cloud, made_by_hand[0])


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(bowl, tmp_path):
    one, two = (
        stream(bowl, tmp_path / f"{jobs}.npy", touches=by_hand.touches(), pose_error=PoseError(2.0, 1.0), jobs=jobs)
        for jobs in (1, 2)
    )
    assert one == two


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"pose_error": PoseError(1.0, 1.0)}, "whose --pose-error differed"),
        ({"touch_as_is": True}, "whose --touch-as-is differed"),
        ({"touches": by_hand.touches(2.0)[:2]}, "whose touches differed"),
    ],
)
def test_another_error_or_unit_does_not_continue_the_work(bowl, tmp_path, monkeypatch, other, said):
    options = {"touches": by_hand.touches()[:2], "pose_error": PoseError(2.0, 1.0)}
    interrupted(monkeypatch, bowl, tmp_path / "out.npy", **options)
    with pytest.raises(UserError, match=said):
        stream(bowl, tmp_path / "out.npy", **{**options, **other})
