"""What is wrong with a recording is said, entry by entry or at once."""

import json

import pytest

from pcsr import UserError
from pcsr.recorded import MANIFEST, read, write
from tests.recorded.recordings import STILL, one_touch, reason, record


@pytest.mark.parametrize(
    ("touch", "expected"),
    [
        ({"cloud": "0.npy"}, "touches.1: pose is missing"),
        ({"cloud": None, "pose": STILL}, "touches.1.cloud: only a finger of a grasp"),
        ({"cloud": "0.npy", "pose": STILL, "unit": "mile"}, "touches.1.unit: unknown unit: use m, cm"),
        ({"cloud": "0.npy", "pose": STILL | {"quaternion": [0, 0, 0, 0]}}, "pose.quaternion: its norm is 0, not 1"),
        ({"cloud": "0.npy", "pose": STILL | {"order": "wxzy"}}, "touches.1.pose.order: it must be 'xyzw' or"),
        ({"cloud": "9.npy", "pose": STILL}, "9.npy cannot be read: No such file"),
        ({"cloud": "../0.npy", "pose": STILL}, "file '../0.npy' is not inside of the recording's folder"),
        ({"cloud": "/0.npy", "pose": STILL}, "file '/0.npy' is not inside"),
        ({"cloud": "touches.json", "pose": STILL}, "no cloud format '.json'"),
        ({"height": "0.npy", "pose": STILL}, "touches.1.mm_per_level is missing: add it; touches.json: touches.1.mm"),
        ({"cloud": "0.npy", "depth": "0.npy"}, "touches.1: it has cloud and depth of the keys"),
        ("0.npy", "touches.1: it has none of the keys"),
        ({"cloud": "0.npy", "pose": STILL, "contact_area": -1}, "touches.1.contact_area: it must be 0 or more, got -1"),
    ],
)
def test_a_bad_entry_is_left_out_and_the_others_go_on(folder, touch, expected):
    text = reason(folder, touch)
    assert text.startswith("touches.json: touches.1")
    assert expected in text


def test_images_need_a_pose_in_any_frame(folder):
    entry = {"height": "0.npy", "mm_per_level": 1, "mm_per_pixel": 1, "contact_above": 0, "indentation": "positive"}
    assert "pose is missing: an image is in the frame of the sensor; add it" in reason(folder, entry, frame="object")


def test_where_nothing_is_of_use_all_reasons_are_given(folder):
    with pytest.raises(UserError, match="not one touch could be used") as caught:
        read(record(folder, {"cloud": "8.npy"}, {"cloud": "9.npy", "pose": STILL}))
    assert "\n  8.npy: touches.json: touches.0: " in str(caught.value)
    assert "\n  9.npy: touches.json: touches.1: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, r"touches\.json cannot be read: No such file or directory: every recording has one"),
        ("{", r"touches\.json is not valid JSON: .*line 1 column 2"),
        (b"\xff", r"touches\.json is not valid JSON"),
        ("[" * 100_000, r"touches\.json is no manifest of touches: it is nested too deeply"),
        ("[]", r"touches\.json holds a list"),
        ({"unit": "furlong"}, r"touches\.json: unit: unknown unit: use m, cm, mm, um, in, .*got 'furlong'"),
        ({"unit": -1}, r"touches\.json: unit: it must be more than 0, got -1"),
        ({"unit": True}, r"touches\.json: unit: "),
        ({"units": "m"}, r"touches\.json: the file takes no 'units': did you mean 'unit'\?"),
        ({"format": 2}, r"touches\.json: format: it must be 1, got 2"),
        ({"frame": "world"}, r"touches\.json: frame: it must be 'sensor' or 'object', got 'world'"),
        ({"axes": "z"}, r"touches\.json: axes: "),
        ({"touches": []}, r"touches\.json: touches: "),
        ({"pose_to": "world"}, r"touches\.json: the file: pose_to 'world' and object_pose.* go together"),
        ({"object_pose": STILL}, r"touches\.json: the file: pose_to 'world' and object_pose.* go together"),
        ({"pose_error": {"position": -1, "rotation": 0}}, r"pose_error\.position: it must be 0 or more, got -1"),
        ({"pose_error": {"position": 101, "rotation": 0}}, r"pose_error\.position: it must be at most 100, got 101"),
        ({"pose_error": {"position": 1, "rotation": 46}}, r"pose_error\.rotation: it must be at most 45, got 46"),
        ({"pose_error": {"position": "1", "rotation": 1}}, r"pose_error\.position: it must be a number, got '1'"),
        ({"pose_error": {"position": 1}}, r"touches\.json: pose_error\.rotation is missing: add it"),
        ({"pose_error": {"position": 1, "rotation": 1, "turn": 1}}, r"pose_error takes no 'turn'"),
        ({"pose_error": 1}, r"touches\.json: pose_error: it must be a mapping, got 1"),
        ({"layout": {"name": "smith-2020"}}, "it has the keys touches and layout: remove one"),
    ],
)
def test_a_manifest_with_mistakes_is_refused_as_a_whole(folder, text, expected):
    if isinstance(text, dict):
        record(folder, {"cloud": "0.npy", "pose": STILL}, **text)
    elif text is not None:
        (folder / MANIFEST).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(UserError, match=expected) as caught:
        read(folder)
    assert str(folder) in str(caught.value)


def test_all_mistakes_of_a_manifest_are_told_at_once(folder):
    (folder / MANIFEST).write_text(json.dumps({"format": 1, "unit": "x", "frame": 3}))
    with pytest.raises(UserError) as caught:
        read(folder)
    lines = str(caught.value).splitlines()
    assert len(lines) == 5
    assert all(line.startswith(f"{folder / MANIFEST}: ") for line in lines)


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        ({"name": "smith2020"}, "layout.name: no layout 'smith2020': did you mean 'smith-2020'"),
        ({}, "layout.name: no layout None"),
        ({"name": "smith-2020", "pre": "grasp"}, "layout takes no 'pre': did you mean 'per'"),
        ({"name": "smith-2020"}, "holds no <grasp>.npy"),
        (7, "layout: it must be a mapping"),
    ],
)
def test_layouts_are_checked(tmp_path, layout, expected):
    (tmp_path / MANIFEST).write_text(json.dumps({"format": 1, "layout": layout}))
    with pytest.raises(UserError, match=expected):
        read(tmp_path)


def test_an_error_of_poses_beside_a_layout_is_checked_too(tmp_path):
    manifest = {"format": 1, "layout": {"name": "smith-2020"}, "pose_error": {"position": 1, "rotation": 50}}
    (tmp_path / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(UserError, match=r"pose_error\.rotation: it must be at most 45, got 50"):
        read(tmp_path)


def test_a_key_that_is_written_twice_is_a_mistake(tmp_path):
    write(tmp_path, [one_touch()])
    manifest = tmp_path / MANIFEST
    manifest.write_text(manifest.read_text().replace('"unit": "mm"', '"unit": "m", "unit": "mm"', 1))
    with pytest.raises(UserError, match="'unit' is written twice"):
        read(tmp_path)


def test_a_folder_that_is_a_file_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for overwrite in (False, True):
        with pytest.raises(UserError, match="file is a file: a recording is a folder"):
            write(tmp_path / "file", [one_touch()], overwrite=overwrite)
