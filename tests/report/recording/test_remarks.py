import numpy as np
import pytest

from pcsr import PoseError, Touch
from pcsr.recorded import Recording
from pcsr.report.recording.facts import touch_facts
from pcsr.report.recording.remarks import remarks, unusable

PATCH = np.stack([*np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-2, 2, 9)), np.full((9, 9), 0.5)], -1).reshape(-1, 3)
PLANE = np.stack([*np.meshgrid(np.linspace(-30, 30, 61), np.linspace(-30, 30, 61)), np.zeros((61, 61))], -1)
CLOUD = PLANE.reshape(-1, 3)
KNOWN = PoseError(0.3, 0.2)


def touch(points=PATCH, x=0.0, z=-0.5, sensor="digit", view=None):
    pose = np.eye(4)
    pose[:3, 3] = x, 0, z
    return Touch.single(points + pose[:3, 3], pose, 1.0, sensor, view=view)


def said(*touches, cloud=None, pose_error=KNOWN):
    recording = Recording(list(touches), [f"t{k}" for k in range(len(touches))], {}, pose_error)
    return remarks(recording, touch_facts(recording, cloud), cloud)


def test_a_good_recording_has_no_remarks():
    assert said(touch(), touch(x=5.0), touch(x=9.0, view=(16.0, 12.0)), cloud=CLOUD) == []


@pytest.mark.parametrize(
    ("odd", "line"),
    [
        (touch(PATCH * [1, 1, -1]), "t0: no point lies above the face of its sensor"),
        (
            touch(PATCH * [1, 1, 20]),
            "t0: the gel is indented by 10 mm, more than the 5 mm that the gel",
        ),
        (touch(PATCH * [1, 1, 70], sensor="x"), "t0: the gel is indented by 35 mm, more than the 30 mm"),
        (touch(PATCH * [25, 1, 1]), "t0: a finger's points are 150 mm wide, more than 100 mm: correct unit"),
        (touch(view=(5.0, 5.0)), "t0: points lie outside of the view of their sensor: correct view or pose"),
        (Touch.single(PATCH, None, 1.0, "digit"), "t0: without a pose, so that the depth"),
    ],
)
def test_what_is_odd_about_a_touch_is_said(odd, line):
    (found,) = said(odd, touch(x=5.0))
    assert found.startswith(line)


def test_touches_with_the_same_remark_are_named_together():
    flat = PATCH * [1, 1, -1]
    (line,) = said(*(touch(flat, x=float(k)) for k in range(5)))
    assert line.startswith("t0, t1, t2 and 2 more: no point lies above")


def test_equal_poses_are_found():
    assert said(touch(), touch(PATCH[:20]), touch(x=3.0)) == ["t0, t1: the poses are equal: was one copied?"]


def test_an_unknown_error_of_the_poses_is_said_if_there_are_poses():
    (line,) = said(touch(), pose_error=None)
    assert line.startswith("pose_error is not stated, so that 1 mm and 2 degrees are assumed")
    assert len(said(Touch.single(PATCH, None, 1.0, "digit"), pose_error=None)) == 1  # that it has no pose


def test_touches_far_from_the_cloud_are_named():
    near, far = touch(z=2.0), touch(z=9.0)
    (line,) = said(near, far, cloud=CLOUD)
    assert line.startswith("t1: farther than 3.9 mm from the cloud: right on a side that the cloud does not show")


def test_touches_that_cannot_be_used_with_a_cloud_have_a_reason():
    away = touch(x=500.0)
    recording = Recording([touch(), away], ["a", "b"], {}, KNOWN)
    reasons = unusable(recording, CLOUD)
    assert list(reasons) == ["b"]
    assert reasons["b"].startswith("is 7.")
    assert "away from the cloud" in reasons["b"]
