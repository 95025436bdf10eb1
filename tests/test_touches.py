"""Touches that a cloud is upsampled with: records are registered, arrays are not, refused ones are named."""

import numpy as np
import pytest

import pcsr
from pcsr import PcsrWarning, PoseError, UserError
from pcsr import touches as module
from pcsr.recorded import write
from pcsr.touches import MOST_NAMED, GivenTouches
from tests.registration.by_hand import NAMES, registration, scan, touches

pytestmark = pytest.mark.filterwarnings("ignore:.*are added to it as unseen surface")


@pytest.fixture
def by_hand(monkeypatch):
    """Let the registration be the one that is made by hand; return the errors it was called with."""
    errors = []

    def register(given, cloud, *, pose_error=None):
        errors.append(pose_error)
        return registration(given)

    monkeypatch.setattr(module, "register", register)
    return errors


def upsampled(given, **options):
    return pcsr.load("midpoint").upsample(scan(400), given, rate=2, **options)


def test_records_are_used_where_they_are_registered(by_hand):
    given = touches()
    expected = [one.touch.points for one in registration(given).touches[:2]]
    with pytest.warns(PcsrWarning, match=r"^1 of 3 touches are refused and not used: touch 2: it fits nowhere$"):
        dense = upsampled(given)
    np.testing.assert_array_equal(dense, upsampled(expected))
    np.testing.assert_array_equal(dense, upsampled(registration(given)))
    assert not np.array_equal(dense, upsampled(given, touch_as_is=True))


def test_arrays_have_no_unit_and_stay_between_records_that_move(by_hand):
    first, second, third = touches()
    found = registration([first, second])
    mixed = GivenTouches.of([first, third.points, second])
    used = mixed.moved(mixed.registration(scan()))
    assert [len(points) for points in used.points(0)] == [60, 60, 60]
    np.testing.assert_array_equal(used.points(0)[1], third.points)
    np.testing.assert_array_equal(used.points(0)[2], found.touches[1].touch.points)
    assert GivenTouches.of([third.points]).registration(scan()) is None


@pytest.mark.parametrize("trusted", [{"touch_as_is": True}, {"pose_error": PoseError(0.0, 0.0)}])
def test_trusted_poses_give_what_arrays_give(trusted):
    given = touches()
    np.testing.assert_array_equal(upsampled(given, **trusted), upsampled([one.points for one in given]))


def test_exact_touches_on_the_surface_stay_there():
    given = touches()
    found = pcsr.register(given, scan(20_000))
    assert len(found.touches) == 3
    for reported, one in zip(given, found.touches, strict=True):
        assert one.verdict in ("kept", "moved", "partly")
        expected = reported.points @ one.motion[:3, :3].T + one.motion[:3, 3]
        assert np.linalg.norm(expected.mean(0) - reported.points.mean(0)) < 0.05


def test_the_error_is_the_argument_or_else_that_of_the_recording(by_hand, tmp_path):
    recorded, given = PoseError(0.3, 0.2), PoseError(2.0, 1.0)
    write(tmp_path / "touches", touches()[:2], NAMES[:2], pose_error=recorded)
    upsampled(tmp_path / "touches")
    upsampled(str(tmp_path / "touches"), pose_error=given)
    upsampled(touches()[:2])
    assert by_hand == [recorded, given, None]


def test_a_refused_touch_of_a_recording_is_named(by_hand, tmp_path):
    write(tmp_path / "touches", touches(), NAMES)
    with pytest.warns(PcsrWarning, match=r"not used: touch 2 \(\[red\]below\): it fits nowhere$"):
        upsampled(tmp_path / "touches")


def test_of_many_refused_touches_a_few_are_named(by_hand):
    first, second, third = touches()
    with pytest.warns(PcsrWarning, match=r"9 of 11 touches are refused .*; and 4 more$") as warned:
        upsampled([first, second, *[third] * 9])
    assert str(warned[0].message).count("it fits nowhere") == MOST_NAMED
    assert "\n" not in str(warned[0].message)


def test_touches_in_another_frame_are_refused_before_they_are_registered(by_hand):
    far = touches()
    far[1].points[:] += 1000
    with pytest.raises(UserError, match=r"^touch 1 is .* across and lies .* away from the cloud"):
        upsampled(far)
    assert by_hand == []
