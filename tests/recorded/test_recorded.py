import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation

from pcsr import RunError, Touch, UserError
from pcsr.clouds.formats import write_points
from pcsr.recorded import MANIFEST, read, write
from pcsr.recorded.layouts import LAYOUTS
from pcsr.recorded.manifest import UNITS, GraspEntry, LayoutManifest, Recorded, check_entry, checked
from pcsr.recorded.pose import rotation_from, sensor_to_object

HEAD = {"format": 1, "unit": "mm", "object_unit": "m", "frame": "sensor", "sensor": "digit"}
STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}
CLOUD = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def record(folder, *touches, **head):
    folder.mkdir(exist_ok=True)
    (folder / MANIFEST).write_text(json.dumps({**HEAD, "touches": list(touches), **head}))
    return folder


@pytest.fixture
def folder(tmp_path):
    """A folder with one cloud."""
    np.save(tmp_path / "0.npy", CLOUD)
    return tmp_path


def only(folder, *touches, **head):
    recording = read(record(folder, *touches, **head))
    assert not recording.skipped
    assert len(recording.touches) == 1
    return recording.touches[0]


def reason(folder, touch, **head):
    """Why one touch is left out, beside a good one that is not."""
    write_points(folder / "good.ply", CLOUD)
    good = {"cloud": "good.ply", "pose": STILL}
    recording = read(record(folder, good, touch, good | {"name": "again"}, **head))
    assert recording.names == ["good.ply", "again"]
    (text,) = recording.skipped.values()
    assert "\n" not in text
    return text


# --- clouds ---


def test_a_cloud_in_the_sensors_frame_goes_through_its_pose(folder):
    pose = {"translation": [10, 0, 0], "euler": [90], "axes": "z", "angle": "degrees"}
    touch = only(folder, {"cloud": "0.npy", "pose": pose, "contact_area": 67.2})
    np.testing.assert_allclose(touch.points, np.array([[10 - 2, 1, 3], [10 - 5, 4, 6]]) / 1000)
    assert (touch.unit, touch.sensor, touch.contact_area) == (1000.0, "digit", 67.2)
    assert touch.finger.tolist() == [0, 0]
    np.testing.assert_allclose(touch.poses[0] @ [1, 2, 3, 1], [*touch.points[0], 1])


def test_clouds_may_have_a_unit_of_their_own(folder):
    touch = only(folder, {"cloud": "0.npy", "pose": STILL, "unit": "cm"})
    np.testing.assert_allclose(touch.points, CLOUD / 100)
    touch = only(folder, {"cloud": "0.npy", "unit": "in"}, frame="object")
    np.testing.assert_allclose(touch.points, CLOUD * 0.0254)


def test_a_cloud_in_the_objects_frame_needs_no_pose(folder):
    touch = only(folder, {"cloud": "0.npy"}, frame="object")
    np.testing.assert_allclose(touch.points, CLOUD / 1000)
    assert touch.poses.shape == (0, 4, 4)
    posed = only(folder, {"cloud": "0.npy", "pose": STILL | {"translation": [5, 0, 0]}}, frame="object")
    np.testing.assert_array_equal(posed.points, touch.points)
    assert posed.poses[0, 0, 3] == 0.005


@pytest.mark.parametrize("axes", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_where_a_sensor_looks_changes_its_pose_and_no_point(folder, axes):
    pose = {"translation": [1, 2, 3], "euler": [10, 20, 30], "axes": "xyz", "angle": "degrees"}
    plain = only(folder, {"cloud": "0.npy", "pose": pose})
    turned = only(folder, {"cloud": "0.npy", "pose": pose}, axes=axes)
    np.testing.assert_array_equal(turned.points, plain.points)
    looks = np.zeros(3)
    looks["xyz".index(axes[1])] = float(axes[0] + "1")
    rotation = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    np.testing.assert_allclose(turned.poses[0, :3, :3] @ [0, 0, -1], rotation @ looks / 1000, atol=1e-12)
    np.testing.assert_array_equal(turned.poses[0, :, 3], plain.poses[0, :, 3])
    assert np.linalg.det(turned.poses[0]) > 0


def test_poses_in_the_world_are_taken_relative_to_the_objects(folder):
    world = {"translation": [100, 0, 0], "quaternion": [0, 0, 1, 0], "order": "xyzw"}
    touch = only(
        folder, {"cloud": "0.npy", "pose": STILL | {"translation": [90, 0, 0]}}, pose_to="world", object_pose=world
    )
    # The object stands at 100 and is turned by half a turn about z; the sensor is 10 on its positive side.
    np.testing.assert_allclose(touch.points, np.array([[10 - 1, -2, 3], [10 - 4, -5, 6]]) / 1000, atol=1e-12)


def test_entries_are_named_by_their_name_or_file(folder):
    pose = {"pose": STILL}
    recording = read(
        record(
            folder,
            {"cloud": "0.npy", **pose},
            {"cloud": "0.npy", "name": "thumb", **pose},
            {"cloud": "0.npy", **pose},
            {"fingers": [{"cloud": "0.npy", **pose}, {"cloud": "0.npy", **pose}]},
        )
    )
    assert recording.names == ["0.npy", "thumb", "0.npy (touches.2)", "0.npy+0.npy"]


# --- images ---


def test_a_height_image_is_placed_by_its_pose(folder):
    levels = np.zeros((5, 7), np.uint16)
    levels[1, 5] = 300
    levels[4, 0] = 200
    levels[0, 0] = 100
    Image.fromarray(levels).save(folder / "3.png")
    Image.fromarray(np.full((5, 7), 50, np.uint8)).save(folder / "bg.png")
    mask = np.full((5, 7), 255, np.uint8)
    mask[4, 0] = 0
    Image.fromarray(mask).save(folder / "mask.png")
    entry = {"height": "3.png", "mm_per_level": 0.01, "mm_per_pixel": 0.5, "contact_above": 0.05} | {
        "indentation": "positive",
        "pose": STILL | {"translation": [0, 0, 10]},
    }
    touch = only(folder, entry, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[-1.5, 1, 11], [1, 0.5, 13], [-1.5, -1, 12]])
    assert touch.contact_area == pytest.approx(3 * 0.25)
    touch = only(folder, entry | {"background": "bg.png", "contact_above": 0.5}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[1, 0.5, 12.5], [-1.5, -1, 11.5]])
    touch = only(folder, entry | {"mask": "mask.png"}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[-1.5, 1, 11], [1, 0.5, 13]])
    np.save(folder / "3.npy", -levels.astype(np.float32))
    touch = only(folder, entry | {"height": "3.npy", "indentation": "negative"}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[-1.5, 1, 11], [1, 0.5, 13], [-1.5, -1, 12]], rtol=1e-6)
    assert "no contact: none of its 35 pixels" in reason(folder, entry | {"indentation": "negative"})


def test_a_depth_image_is_placed_by_its_pose(folder):
    depth = np.full((5, 7), 0.022)
    depth[1, 5] = 0.020
    np.save(folder / "4.npy", depth)
    camera = {"fx": 10.0, "fy": 20.0, "cx": 3.0, "cy": 2.0}
    entry = {"depth": "4.npy", "unit": "m", "intrinsics": camera, "face": 22.0, "contact_above": 0.15, "pose": STILL}
    touch = only(folder, entry, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[2 / 10 * 20, 1 / 20 * 20, 2]])
    assert touch.contact_area == pytest.approx(20**2 / (10 * 20))
    np.save(folder / "bg.npy", depth + 0.0002)
    touch = only(folder, entry | {"background": "bg.npy"}, object_unit="mm")
    assert len(touch.points) == 35
    text = reason(folder, entry | {"background": "bg.npy", "contact_above": 0.3})
    assert "no contact" in text
    np.save(folder / "bg.npy", depth[1:])
    text = reason(folder, entry | {"background": "bg.npy"})
    assert "the background has (4, 7) rows and columns, and the image (5, 7)" in text


# --- grasps ---


def test_fingers_are_one_touch(folder):
    write_points(folder / "1.ply", CLOUD[:1] + 10)
    one = {"cloud": "0.npy", "pose": STILL, "contact_area": 1.5}
    two = {"cloud": "1.ply", "pose": STILL | {"translation": [1, 0, 0]}, "contact_area": 2.0, "sensor": "gel"}
    touch = only(folder, {"name": "grasp 1", "fingers": [one, two]})
    np.testing.assert_allclose(touch.points, np.array([[1, 2, 3], [4, 5, 6], [12, 12, 13]]) / 1000)
    assert touch.finger.tolist() == [0, 0, 1]
    assert touch.poses[:, 0, 3].tolist() == [0, 0.001]
    assert (touch.sensor, touch.contact_area) == ("digit+gel", 3.5)


@pytest.mark.parametrize(
    ("fingers", "expected"),
    [
        ([{"cloud": "0.npy", "pose": STILL}, {"cloud": "9.npy", "pose": STILL}], r"fingers.1: .*9.npy cannot be read"),
        ([{"cloud": "0.npy", "pose": STILL}, {"cloud": "0.npy"}], "fingers.1: pose is missing"),
        ([{"cloud": None, "pose": STILL}], "none of its fingers felt anything"),
        ([{"fingers": [{"cloud": "0.npy"}]}], "fingers.0: it says none: it needs one of cloud, height, depth"),
        ([], "fingers: it must be a list of 1 item or more"),
        ([{"cloud": "0.npy", "pos": STILL}], "fingers.0 takes no 'pos': did you mean 'pose'"),
    ],
)
def test_a_grasp_with_a_bad_finger_is_left_out(folder, fingers, expected):
    text = reason(folder, {"fingers": fingers})
    assert text.startswith("touches.json: touches.1")
    assert re.search(expected, text)


def test_fingers_with_and_without_a_pose_do_not_go_together(folder):
    fingers = [{"cloud": "0.npy"}, {"cloud": "0.npy", "pose": STILL}]
    assert "some fingers have a pose" in reason(folder, {"fingers": fingers}, frame="object")


@pytest.mark.parametrize("order", [[0, 0], [0], [0.0, 1.0], [[0, 1]], 1, [0, 2]])
def test_an_order_that_is_none_is_refused(folder, order):
    np.save(folder / "order.npy", order)
    text = reason(folder, {"fingers": [{"cloud": "0.npy", "pose": STILL}], "order": "order.npy"})
    assert "order: it does not name each of the 2 points once" in text


# --- mistakes ---


@pytest.mark.parametrize(
    ("touch", "expected"),
    [
        ({"cloud": "0.npy"}, "touches.1: pose is missing"),
        ({"cloud": None, "pose": STILL}, "touches.1.cloud: only a finger of a grasp"),
        ({"cloud": "0.npy", "pose": STILL, "unit": "mile"}, "touches.1.unit: no unit of that name"),
        ({"cloud": "0.npy", "pose": STILL | {"quaternion": [0, 0, 0, 0]}}, "pose.quaternion: its norm is 0, not 1"),
        ({"cloud": "0.npy", "pose": STILL | {"order": "wxzy"}}, "touches.1.pose.order: it must be 'xyzw' or"),
        ({"cloud": "9.npy", "pose": STILL}, "9.npy cannot be read: No such file"),
        ({"cloud": "../0.npy", "pose": STILL}, "file '../0.npy' is not inside of the recording's folder"),
        ({"cloud": "/0.npy", "pose": STILL}, "file '/0.npy' is not inside"),
        ({"cloud": "touches.json", "pose": STILL}, "no cloud format '.json'"),
        ({"height": "0.npy", "pose": STILL}, "touches.1.mm_per_level is missing: add it; touches.json: touches.1.mm"),
        ({"cloud": "0.npy", "depth": "0.npy"}, "touches.1: it says cloud and depth: it needs one of"),
        ("0.npy", "touches.1: it says none"),
        ({"cloud": "0.npy", "pose": STILL, "contact_area": -1}, "touches.1.contact_area: it must be 0 or more, got -1"),
    ],
)
def test_a_bad_entry_is_left_out_and_the_others_go_on(folder, touch, expected):
    text = reason(folder, touch)
    assert text.startswith("touches.json: touches.1")
    assert expected in text


def test_images_need_a_pose_in_any_frame(folder):
    entry = {"height": "0.npy", "mm_per_level": 1, "mm_per_pixel": 1, "contact_above": 0, "indentation": "positive"}
    assert "pose is missing: where the sensor was" in reason(folder, entry, frame="object")


def test_where_nothing_is_of_use_all_reasons_are_given(folder):
    with pytest.raises(UserError, match="not one touch could be used") as caught:
        read(record(folder, {"cloud": "8.npy"}, {"cloud": "9.npy", "pose": STILL}))
    assert "\n  8.npy: touches.json: touches.0: " in str(caught.value)
    assert "\n  9.npy: touches.json: touches.1: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, r"touches\.json cannot be read: No such file or directory: a recording has one"),
        ("{", r"touches\.json is no JSON: .*line 1 column 2"),
        (b"\xff", r"touches\.json is no JSON"),
        ("[" * 100_000, r"touches\.json is no JSON"),
        ("[]", r"touches\.json holds a list"),
        ({"unit": "furlong"}, r"touches\.json: unit: no unit of that name: m, cm, mm, um, in, .*got 'furlong'"),
        ({"unit": -1}, r"touches\.json: unit: it must be more than 0, got -1"),
        ({"unit": True}, r"touches\.json: unit: "),
        ({"units": "m"}, r"touches\.json: the file takes no 'units': did you mean 'unit'\?"),
        ({"format": 2}, r"touches\.json: format: it must be 1, got 2"),
        ({"frame": "world"}, r"touches\.json: frame: it must be 'sensor' or 'object', got 'world'"),
        ({"axes": "z"}, r"touches\.json: axes: "),
        ({"touches": []}, r"touches\.json: touches: "),
        ({"pose_to": "world"}, r"touches\.json: the file: pose_to 'world' and object_pose.* go together"),
        ({"object_pose": STILL}, r"touches\.json: the file: pose_to 'world' and object_pose.* go together"),
        ({"layout": {"name": "smith-2020"}}, "says touches and layout"),
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


# --- writing ---

LENGTHS = st.floats(0.01, 1000)


@st.composite
def random_touches(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    unit = draw(LENGTHS)
    touches = []
    for _ in range(draw(st.integers(1, 3))):
        fingers, n = draw(st.integers(1, 4)), draw(st.integers(1, 9))
        posed = draw(st.booleans())
        poses = np.tile(np.eye(4), (fingers, 1, 1))
        poses[:, :3, :3] = Rotation.random(fingers, rng).as_matrix() / unit
        poses[:, :3, 3] = rng.normal(size=(fingers, 3)) * 10 ** rng.uniform(-9, 9)
        points = rng.normal(size=(n, 3)) * 10 ** rng.uniform(-9, 9)
        finger = rng.integers(0, fingers, n)
        area = draw(st.none() | st.floats(0, 1e6))
        touches.append(Touch(points, finger, poses if posed else poses[:0], unit, draw(st.sampled_from("ab+ü")), area))
    return touches


@settings(max_examples=60)
@given(touches=random_touches())
def test_what_is_written_comes_back_to_the_last_bit(tmp_path_factory, touches):
    folder = tmp_path_factory.mktemp("recording")
    names = [f"touch {number}" for number in range(len(touches))]
    write(folder, touches, names)
    recording = read(folder)
    assert recording.names == names
    assert not recording.skipped
    for a, b in zip(touches, recording.touches, strict=True):
        for field in ("points", "finger", "poses"):
            one, other = getattr(a, field), getattr(b, field)
            assert one.dtype == other.dtype
            assert one.shape == other.shape
            assert one.tobytes() == other.tobytes()
        assert (a.unit, a.sensor, a.contact_area) == (b.unit, b.sensor, b.contact_area)


def one_touch(**changes):
    fields = {"points": CLOUD, "finger": np.zeros(2, np.int64), "poses": np.eye(4)[None], "unit": 1.0, "sensor": "x"}
    return Touch(**{**fields, "contact_area": None, **changes})


def test_a_recording_is_not_overwritten_unless_asked(tmp_path):
    write(tmp_path / "new" / "folder", [one_touch()])
    folder = tmp_path / "new" / "folder"
    assert read(folder).names == ["0.ply"]
    with pytest.raises(UserError, match="holds a recording already"):
        write(folder, [one_touch(points=CLOUD + 1)])
    np.testing.assert_array_equal(read(folder).touches[0].points, CLOUD)
    write(folder, [one_touch(points=CLOUD + 1)], overwrite=True)
    np.testing.assert_array_equal(read(folder).touches[0].points, CLOUD + 1)


def test_a_recording_that_was_not_finished_has_no_manifest_and_can_be_written_again(tmp_path, monkeypatch):
    real = os.replace

    def full(source, target):
        if str(target).endswith("1.ply"):
            raise OSError(28, "No space left on device")
        real(source, target)

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", full)
        with pytest.raises(RunError, match=r"1\.ply could not be written"):
            write(tmp_path, [one_touch(), one_touch()])
    with pytest.raises(UserError, match="cannot be read"):
        read(tmp_path)
    write(tmp_path, [one_touch(), one_touch()])
    assert len(read(tmp_path).touches) == 2


@pytest.mark.parametrize(
    ("touches", "expected"),
    [
        ([], r"one unit, got \[\]"),
        ([one_touch(), one_touch(unit=2.0, poses=np.zeros((0, 4, 4)))], r"one unit, got \[1.0, 2.0\]"),
        ([one_touch(points=CLOUD * np.nan)], "touch 0 by 'x' cannot be recorded"),
        ([one_touch(points=CLOUD[:0], finger=np.zeros(0, np.int64))], "cannot be recorded: it has 0 points"),
        ([one_touch(finger=np.array([0, 1]))], "of 2 fingers and 1 poses"),
        ([one_touch(contact_area=float("nan"))], "its contact area is nan"),
        ([one_touch(poses=2 * np.eye(4)[None])], "touch 0: pose 0: its last row"),
        ([one_touch(unit=5.0)], "touch 0: pose 0 scales by 1, .* by 0.2"),
    ],
)
def test_touches_that_could_not_be_read_again_are_not_written(tmp_path, touches, expected):
    with pytest.raises(UserError, match=expected):
        write(tmp_path, touches)
    assert not list(tmp_path.iterdir())


def test_each_touch_needs_a_name_or_none_does(tmp_path):
    with pytest.raises(UserError, match="1 names for 2 touches"):
        write(tmp_path, [one_touch(), one_touch()], ["a"])


# --- documentation ---

PAGE = (Path(__file__).parents[2] / "docs" / "recorded.md").read_text(encoding="utf-8")
EXAMPLES = [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]


def test_the_examples_of_the_page_are_right():
    manifests = [example for example in EXAMPLES if "touches" in example]
    for example in manifests:
        recorded = checked(Recorded, example, "")
        for index, value in enumerate(recorded.touches):
            entry = check_entry(value, f"touches.{index}")
            fingers = entry.fingers if isinstance(entry, GraspEntry) else [value]
            for finger in fingers:
                pose = check_entry(finger, "finger", in_grasp=True).pose
                sensor_to_object(pose, recorded.unit, recorded.object_unit)
    said = [checked(LayoutManifest, example, "").layout for example in EXAMPLES if "layout" in example]
    for layout in said:
        options, _ = LAYOUTS[layout.pop("name")]
        checked(options, layout, "layout")
    assert len(manifests) == 2
    assert len(said) == len(LAYOUTS) + 1  # of ycb-slide there are two kinds


def test_the_page_tells_every_turn():
    rows = re.findall(r"^\| `([+-][xyz])` \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) == 6
    for axes, told in rows:
        for ours, theirs in enumerate(told.replace("−", "-").split(" | ")):
            expected = np.zeros(3)
            expected["xyz".index(theirs[1])] = float(theirs[0] + "1")
            np.testing.assert_array_equal(rotation_from(axes)[:3, ours], expected)


def test_the_page_names_every_layout_and_key():
    for name, (options, _) in LAYOUTS.items():
        section = PAGE.split(f"### {name}\n")[1].split("\n## ")[0].split("\n### ")[0]
        for key in options.model_fields:
            assert f'"{key}"' in section or f"`{key}`" in section, f"{name}: {key}"
    for key in {**Recorded.model_fields, **UNITS}:
        assert f"`{key}`" in PAGE


def test_a_key_that_is_written_twice_is_a_mistake(tmp_path):
    write(tmp_path, [one_touch()])
    manifest = tmp_path / MANIFEST
    manifest.write_text(manifest.read_text().replace('"unit": "mm"', '"unit": "m", "unit": "mm"', 1))
    with pytest.raises(UserError, match="'unit' is written twice"):
        read(tmp_path)


def test_a_file_of_somebody_elses_is_never_overwritten(tmp_path):
    (tmp_path / "0.ply").write_text("a mesh")
    for overwrite in (False, True):
        with pytest.raises(UserError, match=r"0\.ply is there already and of no recording"):
            write(tmp_path, [one_touch()], overwrite=overwrite)
    assert (tmp_path / "0.ply").read_text() == "a mesh"
    assert not (tmp_path / MANIFEST).exists()


def test_overwriting_leaves_nothing_of_the_old_recording(tmp_path):
    write(tmp_path, [one_touch(), one_touch(), one_touch()])
    (tmp_path / "notes.txt").write_text("mine")
    write(tmp_path, [one_touch()], overwrite=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.ply", "notes.txt", MANIFEST]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_is_stopped_leaves_nothing(tmp_path, monkeypatch, error):
    real = os.replace

    def full(source, target):
        if str(target).endswith("2.ply"):
            raise error
        real(source, target)

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    monkeypatch.setattr(os, "replace", full)
    for folder in (tmp_path / "mine", tmp_path / "new"):
        with pytest.raises((RunError, KeyboardInterrupt)):
            write(folder, [one_touch()] * 4)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]
    assert not (tmp_path / "new").exists()


def test_a_folder_that_is_a_file_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for overwrite in (False, True):
        with pytest.raises(UserError, match="file is a file: a recording is a folder"):
            write(tmp_path / "file", [one_touch()], overwrite=overwrite)


def test_a_recording_is_found_by_text_and_by_its_manifest_too(tmp_path):
    write(tmp_path, [one_touch()])
    for place in (str(tmp_path), tmp_path / MANIFEST, str(tmp_path / MANIFEST)):
        assert np.array_equal(read(place).touches[0].points, read(tmp_path).touches[0].points)
