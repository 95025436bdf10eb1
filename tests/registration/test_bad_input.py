"""Touches and clouds that cannot be registered get a verdict, without an exception or a warning."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from pcsr import PoseError, Touch, register
from pcsr.registration import Verdict
from tests.registration.patches import (
    CLOUD,
    EXACT,
    SIDES,
    bumpy,
    bumpy_scan,
    bumpy_touch,
    by,
    left,
    plate,
    pressed,
    rigid,
    scan,
    wavy,
)

GOOD = [by(touch, rigid([0.5, -1, 0.5], [0.3, -0.4, 0.5])) for touch in EXACT]
LINE = np.column_stack([np.linspace(-4, 4, 100), np.zeros(100), np.full(100, 20.0)])

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(autouse=True)
def _strict():
    with np.errstate(all="raise", under="ignore"):
        yield


def single(points, pose=True):
    frame = np.eye(4)
    frame[:3, 3] = points.mean(0)
    return Touch.single(points, frame if pose else None, 1.0, "digit")


def blind(touch):
    return replace(touch, poses=touch.poses[:0])


BAD = {
    "another frame": by(EXACT[0], rigid([0, 0, 0], [60, 0, 0])),
    "far away": by(EXACT[0], rigid([0, 0, 0], [1e4, 0, 0])),
    "other side": by(EXACT[0], rigid([180, 0, 0], [0, 0, 0])),
    "upside down": replace(EXACT[0], poses=EXACT[0].poses @ np.diag([1.0, -1, -1, 1])),
    "another object": by(pressed(wavy), rigid([0, 0, 0], [0, 0, 20])),
    "line": single(LINE),
    "line, no pose": single(LINE, pose=False),
    "line along the pose": single(LINE[:, [2, 1, 0]]),
    "slanted line": single(np.linspace(-4, 4, 100)[:, None] * [1, 1, 0.1] + [0, 0, 20.0]),
    "equal points": single(np.repeat(LINE[:1], 50, axis=0)),
    "equal points, no pose": single(np.repeat(LINE[:1], 50, axis=0), pose=False),
    "repeated points": single(np.repeat(EXACT[0].points[:5], 50, axis=0)),
    "three points": single(EXACT[0].points[:3]),
    "five points": single(EXACT[0].points[:5]),
    "one point": single(EXACT[0].points[:1]),
    "one point, no pose": single(EXACT[0].points[:1], pose=False),
    "no pose": blind(EXACT[0]),
    "fingers": Touch.grasp(EXACT[:3]),
    "fingers, no poses": Touch.grasp([blind(touch) for touch in EXACT[:3]]),
    "fingers, one on a line": Touch.grasp([EXACT[0], single(LINE)]),
    "image": bumpy_touch(SIDES[0], count=76_000),
}
WORTHLESS = {"another frame", "other side", "another object", "five points"}
NO_SURFACE = {name for name in BAD if "line" in name or "equal" in name or name.startswith(("one", "three"))}
NO_SURFACE -= {"fingers, one on a line"}


def check(found, touches):
    """Each touch has a verdict that fits its points, and all numbers are finite."""
    assert len(found.touches) == len(touches)
    for one, touch in zip(found.touches, touches, strict=True):
        assert one.verdict in get_args(Verdict)
        assert one.reason
        assert "inf" not in one.reason
        assert "nan" not in one.reason
        assert len(one.errors) == len(one.touch.points) == len(one.touch.finger)
        used = len(one.touch.points) / len(touch.points)
        assert {"refused": used == 0, "partly": 0 < used < 1}.get(one.verdict, used == 1)
        for numbers in (one.motion, one.covariance, one.errors, one.touch.points):
            assert np.isfinite(numbers).all()
        turn = one.motion[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        if one.verdict == "kept":
            np.testing.assert_array_equal(one.touch.points, touch.points)
    for numbers in (found.offset, found.offset_covariance, found.shared_error, found.private_error):
        assert np.isfinite(numbers).all()


@pytest.mark.parametrize("name", BAD)
def test_one_bad_touch_does_no_harm(name):
    touches = [BAD[name], *GOOD]
    found = register(touches, CLOUD)
    check(found, touches)
    if name in WORTHLESS:
        assert found.touches[0].verdict == "refused"
    if name in NO_SURFACE:
        assert found.touches[0].reason == "its points make no surface, so that it cannot be checked"
    for one, touch, exact in zip(found.touches[1:], GOOD, EXACT, strict=True):
        assert one.verdict == "moved"
        assert np.linalg.norm(left((one, touch), exact), axis=1).mean() < 0.25


@pytest.mark.parametrize("name", BAD)
def test_a_bad_touch_alone_gets_its_verdict(name):
    found = register([BAD[name]], CLOUD)
    check(found, [BAD[name]])
    if name in NO_SURFACE:
        assert found.touches[0].verdict == "refused"  # the cloud is seen there, and is better than the pose


def test_a_touch_without_a_surface_is_kept_where_no_cloud_is():
    touch = single(LINE + np.array([0, 0, 40]))
    one = register([touch], CLOUD[CLOUD[:, 2] < 0]).touches[0]
    assert (one.verdict, one.reason) == ("kept", "its points make no surface, so that it cannot be checked")
    np.testing.assert_array_equal(one.motion, np.eye(4))


def test_a_touch_without_a_cloud_around_it_stays_where_it_is():
    touch = by(EXACT[0], rigid([0, 0, 0], [40, 0, 0]))
    one = register([touch], CLOUD[CLOUD[:, 0] < -5]).touches[0]
    np.testing.assert_array_equal(one.motion, np.eye(4))
    assert one.verdict == "kept"


CLOUDS = {
    "repeated points": np.repeat(CLOUD, 3, axis=0),
    "16 points": bumpy_scan(16),
    "one point": CLOUD[:1],
    "two points": CLOUD[:2],
    "equal points": np.repeat(CLOUD[:1], 100, axis=0),
    "line": LINE,
    "flat": plate(CLOUD[:, :2]),
    "far from the touches": CLOUD + np.array([500, 0, 0]),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_any_cloud_gives_a_verdict(name):
    touches = [GOOD[0], blind(GOOD[1])]
    check(register(touches, CLOUDS[name]), touches)


def test_repeated_points_of_the_cloud_count_once():
    once, thrice = register(GOOD[:2], CLOUD), register(GOOD[:2], CLOUDS["repeated points"])
    for one, other in zip(once.touches, thrice.touches, strict=True):
        assert (one.verdict, one.support) == (other.verdict, other.support)
        np.testing.assert_allclose(one.motion, other.motion, atol=1e-6)


def test_far_from_the_origin_nothing_changes():
    far = rigid([0, 0, 0], [1e6, -1e6, 1e6])
    there = register([by(touch, far) for touch in GOOD[:2]], CLOUD + far[:3, 3])
    for one, other in zip(register(GOOD[:2], CLOUD).touches, there.touches, strict=True):
        assert (one.verdict, one.support) == (other.verdict, other.support)
        np.testing.assert_allclose(one.touch.points + far[:3, 3], other.touch.points, atol=1e-4)


@pytest.mark.parametrize("error", [(100.0, 45.0), (1.0, 0.0), (0.0, 1.0), (1e-6, 1e-6), (5.0, 10.0)])
def test_any_stated_error_gives_a_verdict(error):
    touches = [GOOD[0], blind(GOOD[1])]
    check(register(touches, CLOUD, pose_error=PoseError(*error)), touches)


def test_a_plate_without_an_edge_gives_a_verdict():
    touches = [by(pressed(plate, at), rigid([1, 0, 0], [0.3, 0.2, 0.5])) for at in [(0, 0), (5, 5)]]
    check(register(touches, scan(plate)), touches)


@pytest.mark.parametrize("spacing", [1e2, 1e4, 1e6, 1e8])
def test_a_cloud_far_coarser_than_the_touches_gives_a_verdict(spacing):
    touches = [by(pressed(plate, at), rigid([1, 0, 0], [0.3, 0.2, 0.5])) for at in [(0, 0), (5, 5)]]
    check(register(touches, np.random.default_rng(0).normal(size=(100, 3)) * spacing), touches)


def test_many_touches_find_their_places():
    directions = np.random.default_rng(0).normal(size=(30, 3))
    exact = [bumpy_touch(towards, count=200) for towards in directions]
    touches = [by(touch, rigid([0.5, -1, 0.5], [0.3, -0.4, 0.5])) for touch in exact]
    found = register(touches, bumpy(np.random.default_rng(1).normal(size=(2000, 3))))
    check(found, touches)
    triples = zip(found.touches, touches, exact, strict=True)
    away = [np.linalg.norm(left((one, touch), true), axis=1).mean() for one, touch, true in triples]
    assert np.median(away) < 0.15
