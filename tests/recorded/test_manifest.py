import numpy as np
import pytest

from pcsr import UserError
from pcsr.files import inside
from pcsr.recorded.fields import UNITS
from pcsr.recorded.manifest import (
    CloudEntry,
    DepthEntry,
    GraspEntry,
    HeightEntry,
    RecordingManifest,
    check_entry,
    checked,
)
from pcsr.recorded.pose_models import EulerPose, MatrixPose, QuaternionPose

HEAD = {"format": 1, "unit": "mm", "object_unit": 3.7, "frame": "sensor", "sensor": "digit", "touches": [1]}
CAMERA = {"fx": 1, "fy": 1.0, "cx": 0, "cy": -1}
STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}


def mistakes(model, value, place=""):
    with pytest.raises(UserError) as caught:
        checked(model, value, place)
    return str(caught.value).splitlines()


@pytest.mark.parametrize(("name", "length"), UNITS.items())
def test_units_are_names_or_lengths(name, length):
    assert checked(RecordingManifest, HEAD | {"unit": name}, "").unit == length
    assert checked(RecordingManifest, HEAD | {"unit": length}, "").unit == length


def test_whole_numbers_are_lengths_too_and_text_and_truth_are_none():
    assert checked(RecordingManifest, HEAD | {"unit": 5}, "").unit == 5
    for wrong in ("5", True, 0, -1, float("nan"), float("inf"), None, ["mm"]):
        (line,) = mistakes(RecordingManifest, HEAD | {"unit": wrong})
        assert line.startswith("touches.json: unit: ")


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        ({"cloud": "a"}, CloudEntry),
        ({"height": "a", "mm_per_level": 1, "mm_per_pixel": 1, "indentation": "negative", "contact_above": 0},
         HeightEntry),
        ({"depth": "a", "unit": "m", "intrinsics": CAMERA, "face": 22, "contact_above": 0.1}, DepthEntry),
        ({"fingers": [{}]}, GraspEntry),
    ],
)  # fmt: skip
def test_an_entry_is_what_its_key_says(value, kind):
    assert type(check_entry(value, "touches.0")) is kind


@pytest.mark.parametrize(
    ("pose", "kind"),
    [
        ({"matrix": np.eye(4).tolist()}, MatrixPose),
        (STILL, QuaternionPose),
        ({"translation": [0, 0, 0], "euler": [1], "axes": "x", "angle": "degrees"}, EulerPose),
    ],
)
def test_a_pose_is_what_its_key_says(pose, kind):
    assert type(check_entry({"cloud": "a", "pose": pose}, "touches.0").pose) is kind


@pytest.mark.parametrize(
    ("pose", "line"),
    [
        (STILL | {"order": "xyz"}, "pose.order: it must be 'xyzw' or 'wxyz', got 'xyz'"),
        (STILL | {"ordr": "xyz"}, "pose takes no 'ordr': did you mean 'order'?"),
        (STILL | {"quaternion": [0, 0, 1]}, "pose.quaternion: it must be a list of 4 items or more"),
        (STILL | {"quaternion": [0, 0, 0, "1"]}, "pose.quaternion.3: it must be a number, got '1'"),
        (STILL | {"translation": [0, 0, float("nan")]}, "pose.translation.2: it must be a finite number, got nan"),
        (STILL | {"matrix": []}, "pose: a pose has exactly one of the keys matrix, quaternion and euler"),
        ({}, "pose: a pose has exactly one of the keys matrix, quaternion and euler"),
        ([1], "pose: a pose has exactly one of the keys matrix, quaternion and euler, got [1]"),
        ({"matrix": [[1, 0, 0, 0]] * 3}, "pose.matrix: it must be a list of 4 items or more"),
        ({"matrix": [[1, 0, 0]] * 4}, "pose.matrix.0: it must be a list of 4 items or more"),
        ({"translation": [0, 0, 0], "euler": [1], "axes": "xY", "angle": "degrees"}, "pose.axes: it must be text that"),
        ({"translation": [0, 0, 0], "euler": [1], "axes": "x"}, "pose.angle is missing: add it"),
    ],
)
def test_a_mistake_in_a_pose_is_named_with_its_keys(pose, line):
    with pytest.raises(UserError) as caught:
        check_entry({"cloud": "a", "pose": pose}, "touches.2")
    assert str(caught.value).startswith(f"touches.json: touches.2.{line}")


def test_each_mistake_has_a_line():
    lines = mistakes(RecordingManifest, {"format": 1, "unit": "x", "frames": "sensor"})
    assert lines == [
        "touches.json: unit: unknown unit: use m, cm, mm, um, in, or the unit's length in mm as a number, got 'x'",
        "touches.json: object_unit is missing: add it",
        "touches.json: frame is missing: add it",
        "touches.json: sensor is missing: add it",
        "touches.json: touches is missing: add it",
        "touches.json: the file takes no 'frames': did you mean 'frame'?",
    ]


def test_keys_of_a_camera_are_suggested_where_it_has_a_mistake():
    entry = {"depth": "a", "unit": "m", "intrinsics": CAMERA | {"fz": 1}, "face": 22, "contact_above": 0.1}
    assert mistakes(DepthEntry, entry, "touches.0") == [
        "touches.json: touches.0.intrinsics takes no 'fz': known: cx, cy, fx, fy"
    ]


@pytest.mark.parametrize("value", [None, "a.ply", [], {}, {"name": "x"}, {"cloud": "a", "height": "b"}])
def test_an_entry_of_no_kind_or_of_two_is_refused(value):
    with pytest.raises(UserError, match=r"touches.json: touches.3: it has (none|cloud and height) of the keys"):
        check_entry(value, "touches.3")


def test_only_a_finger_may_have_felt_nothing_and_holds_no_fingers():
    assert check_entry({"cloud": None}, "touches.0.fingers.1", in_grasp=True).cloud is None
    with pytest.raises(UserError, match=r"touches\.0\.cloud: only a finger"):
        check_entry({"cloud": None}, "touches.0")
    with pytest.raises(UserError, match="it has none of the keys cloud, height, depth"):
        check_entry({"fingers": [{}]}, "touches.0.fingers.1", in_grasp=True)


@pytest.mark.parametrize("name", ["a.ply", "deep/a.ply", "./a.ply", "none.ply", "deep/.hidden", "two..dots.ply"])
def test_files_inside_of_the_folder_are_found(tmp_path, name):
    assert inside(tmp_path, name) == tmp_path / name


@pytest.mark.parametrize(
    "name",
    ["../a.ply", "deep/../a.ply", "/a", "", ".", "..", "C:\\a", "C:a", "..\\a", "\\a", "a\0b", "out/a.ply", "loop/a"],
)
def test_files_outside_of_the_folder_are_refused(tmp_path, name):
    folder = tmp_path / "recording"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    with pytest.raises(UserError, match="is not inside of the recording's folder"):
        inside(folder, name)


def test_a_recording_may_lie_behind_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert inside(tmp_path / "link", "a.ply") == tmp_path / "link" / "a.ply"
