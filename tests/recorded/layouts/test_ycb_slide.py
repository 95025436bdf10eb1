import json
import os
import pickle  # noqa: TID251
import sys
import types

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from pcsr import PoseError, UserError
from pcsr.recorded import read
from tests.recorded.pressed import pressed

SHAPE = (32, 24)
FOCAL = 0.5 * 32 / np.tan(np.pi / 6)


class Hostile:
    """Unpickled the usual way, it writes a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def poses(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.hstack([rng.normal(size=(count, 3)) * 0.1, Rotation.random(count, rng).as_quat()])


def matrix(row):
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = Rotation.from_quat(row[3:]).as_matrix(), row[:3]
    return whole


def picture(path, levels):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(levels).save(path, quality=100)


def block(level):
    """A flat patch of one level: JPEG keeps it where it fills its blocks of 8 pixels."""
    levels = np.zeros(SHAPE, np.uint8)
    levels[8:16, 8:24] = level
    return levels


def config(monkeypatch):
    """An object of a class that is not there when the file is read, as the simulated files hold one."""
    module = types.ModuleType("omegaconf.dictconfig")
    made = type("DictConfig", (), {"__module__": module.__name__, "__qualname__": "DictConfig"})
    module.DictConfig = made
    monkeypatch.setitem(sys.modules, "omegaconf", types.ModuleType("omegaconf"))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    one = made()
    one.noise = {"trans": 0.5}
    return one


@pytest.fixture
def simulated(tmp_path, monkeypatch):
    data = {"gelposes": poses(3, 1), "camposes": poses(3), "gelposes_meas": poses(3, 2), "mNoise": config(monkeypatch)}
    (tmp_path / "tactile_data.pkl").write_bytes(pickle.dumps(data, 4))
    for index in range(3):
        picture(tmp_path / "gt_heightmaps" / f"{index}.jpg", np.full(SHAPE, 100, np.uint8))
        picture(tmp_path / "gt_contactmasks" / f"{index}.jpg", block(255))
    return tmp_path


def say(folder, **options):
    layout = {"name": "ycb-slide", "kind": "simulated", **options}
    (folder / "touches.json").write_text(json.dumps({"format": 1, "layout": layout}))
    return read(folder)


def seen(level):
    """What the camera sees in the block, in its own frame and in metres."""
    v, u = np.mgrid[8:16, 8:24].reshape(2, -1)
    z = 0.022 - level * 0.03e-3
    return np.stack([(u - 12) / FOCAL * z, -(v - 16) / FOCAL * z, np.full(v.shape, -z)], axis=-1)


def test_a_simulated_slide_is_placed_by_its_cameras(simulated):
    recording = say(simulated)
    assert recording.names == ["0.jpg", "1.jpg", "2.jpg"]
    assert not recording.skipped
    for row, touch in zip(poses(3), recording.touches, strict=True):
        expected = seen(100) @ matrix(row)[:3, :3].T + row[:3]
        np.testing.assert_allclose(touch.points, expected, atol=1e-12)
        assert (touch.unit, touch.sensor) == (1000.0, "digit")
        assert touch.contact_area == pytest.approx(128 * (19 / FOCAL) ** 2)
        inverse = np.linalg.inv(touch.poses[0])
        local = touch.points @ inverse[:3, :3].T + inverse[:3, 3]
        np.testing.assert_allclose(local[:, 2], 3)  # mm above the gel's face
        np.testing.assert_allclose(touch.poses[0] @ [0, 0, 22, 1], [*row[:3], 1])  # the camera is behind it


def test_the_measured_poses_are_those_of_the_face_and_have_a_known_error(simulated):
    assert say(simulated).pose_error is None
    recording = say(simulated, poses="measured")
    assert recording.pose_error == PoseError(0.5, 1.0)
    for row, touch in zip(poses(3, 2), recording.touches, strict=True):
        np.testing.assert_allclose(touch.poses[0] @ [0, 0, 0, 1], [*row[:3], 1])
        expected = (seen(100) + np.array([0, 0, 0.022])) @ matrix(row)[:3, :3].T + row[:3]
        np.testing.assert_allclose(touch.points, expected, atol=1e-12)
    layout = {"name": "ycb-slide", "kind": "simulated", "poses": "measured"}
    stated = {"format": 1, "layout": layout, "pose_error": {"position": 1, "rotation": 3}}
    (simulated / "touches.json").write_text(json.dumps(stated))
    assert read(simulated).pose_error == PoseError(1.0, 3.0)


def test_every_so_many_frames_are_touches(simulated):
    assert say(simulated, every=2).names == ["0.jpg", "2.jpg"]


def test_frames_that_lack_something_are_left_out(simulated):
    (simulated / "gt_heightmaps" / "0.jpg").unlink()
    picture(simulated / "gt_contactmasks" / "1.jpg", np.zeros(SHAPE, np.uint8))
    recording = say(simulated)
    assert recording.names == ["2.jpg"]
    assert "0.jpg cannot be read" in recording.skipped["0.jpg"]
    assert "no contact" in recording.skipped["1.jpg"]
    picture(simulated / "gt_contactmasks" / "0.jpg", np.zeros((8, 8), np.uint8))
    picture(simulated / "gt_heightmaps" / "0.jpg", np.zeros(SHAPE, np.uint8))
    assert "the mask has (8, 8)" in say(simulated).skipped["0.jpg"]


@pytest.fixture
def real(tmp_path):
    data = {
        "start_time": 1.5,
        "digit_frames": ["x"],
        "poses": {"DIGIT": poses(2), "035_power_drill": poses(2, 5)},
    }
    np.save(tmp_path / "synced_data.npy", np.array(data, dtype=object))
    for index in range(2):
        picture(tmp_path / "heights" / f"frame_{index:07d}.jpg", block(100))
        picture(tmp_path / "masks" / f"frame_{index:07d}.jpg", block(255))
    return tmp_path


def test_a_real_slide_is_placed_relative_to_its_object(real):
    for options in ({"masks": "masks"}, {"contact_above": 0.15}):
        recording = say(real, kind="real", heights="heights", **options)
        assert recording.names == ["frame_0000000.jpg", "frame_0000001.jpg"]
        for digit, thing, touch in zip(poses(2), poses(2, 5), recording.touches, strict=True):
            relative = np.linalg.inv(matrix(thing)) @ matrix(digit)
            expected = seen(100) @ relative[:3, :3].T + relative[:3, 3]
            np.testing.assert_allclose(touch.points, expected, atol=1e-12)


def test_contact_is_counted_from_the_background(real):
    picture(real / "bg.png", np.full(SHAPE, 90, np.uint8))
    options = {"kind": "real", "heights": "heights", "background": "bg.png"}
    assert len(say(real, contact_above=0.29, **options).touches[0].points) == 128
    with pytest.raises(UserError, match="no contact"):
        say(real, contact_above=0.31, **options)


def test_contact_is_found_above_the_background(real):
    dome = np.linspace(0, 80, 24).astype(np.uint8) * np.ones((32, 1), np.uint8)
    picture(real / "bg.png", dome)
    indentation, contact = pressed(0.5, middle=(16, 12), shape=SHAPE)
    levels = np.round(indentation / 0.03).astype(np.uint8)
    for index in range(2):
        Image.fromarray(dome + levels).save(real / "heights" / f"frame_{index:07d}.jpg", "PNG")
    touches = say(real, kind="real", heights="heights", background="bg.png").touches
    assert [len(touch.points) for touch in touches] == [(levels > 0.4 * levels.max()).sum()] * 2
    assert (levels > 0.4 * levels.max()).sum() == pytest.approx(contact.sum(), rel=0.15)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"kind": "real"}, r"a real slide holds camera images: .* or calibrate the sensor \(pcsr sensor calibrate\)"),
        ({"kind": "real", "heights": "h"}, "the contact of a real slide is unknown: give masks or background"),
        ({"kind": "real", "heights": "h", "masks": "m", "contact_above": 1}, "masks show the contact: leave out"),
        ({"kind": "real", "heights": "h", "masks": "m", "background": "b"}, "masks show the contact: leave out"),
        ({"kind": "real", "heights": "h", "masks": "m", "poses": "camera"}, "poses chooses between those of a sim"),
        ({"poses": "gel"}, "layout.poses: it must be 'camera' or 'measured', got 'gel'"),
        ({"alignment": "a"}, "a simulated slide has its own heights and masks: leave out alignment"),
        ({"heights": "h"}, "a simulated slide has its own heights and masks: leave out heights"),
        ({"kind": "virtual"}, "layout.kind: it must be 'simulated' or 'real', got 'virtual'"),
        ({"every": 0}, "layout.every: it must be 1 or more, got 0"),
        ({"kind": "real", "heights": "../h", "masks": "m"}, "file '../h/frame_0000000.jpg' is not inside"),
    ],
)
def test_options_that_do_not_go_together_are_refused(real, options, reason):
    with pytest.raises(UserError, match=reason):
        say(real, **options)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ({"poses": {"DIGIT": poses(2)}}, r"holds poses of DIGIT and \[\]: it needs those of DIGIT and of one object"),
        ({"poses": {"DIGIT": poses(2), "a": poses(2), "b": poses(2)}}, r"of DIGIT and \['a', 'b'\]"),
        ({"poses": {"DIGIT": poses(2), "a": poses(3)}}, "holds 2 poses of DIGIT and 3 of a"),
        ({"poses": {"a": poses(2)}}, "poses has no DIGIT"),
        ({"poses": {"DIGIT": poses(2)[:, :6], "a": poses(2)}}, r"poses of DIGIT must have shape \(n, 7\)"),
        ({"poses": {"DIGIT": poses(2) * 2, "a": poses(2)}}, r"a pose of DIGIT\.quaternion: its norm is 2"),
        ({"frames": 1}, "has no poses"),
        (7, "has no poses"),
    ],
)
def test_poses_that_are_none_are_refused(real, data, reason):
    np.save(real / "synced_data.npy", np.array(data, dtype=object))
    with pytest.raises(UserError, match=reason):
        say(real, kind="real", heights="heights", masks="masks")


def test_frames_where_the_tracking_was_lost_are_left_out(real):
    lost = poses(2)
    lost[0] = np.nan
    for row in (np.full(7, np.nan), np.zeros(7)):
        lost[0] = row
        data = {"poses": {"DIGIT": poses(2), "035_power_drill": lost}}
        np.save(real / "synced_data.npy", np.array(data, dtype=object))
        recording = say(real, kind="real", heights="heights", masks="masks")
        assert recording.names == ["frame_0000001.jpg"]
        assert "a pose of 035_power_drill" in recording.skipped["frame_0000000.jpg"]


def test_an_alignment_moves_what_was_felt(real):
    alignment = matrix(poses(1, 9)[0])
    np.save(real / "alignment.npy", alignment)
    options = {"kind": "real", "heights": "heights", "masks": "masks"}
    for before, after in zip(
        say(real, **options).touches, say(real, alignment="alignment.npy", **options).touches, strict=True
    ):
        np.testing.assert_allclose(after.points, before.points + alignment[:3, 3])
        np.testing.assert_array_equal(after.poses[0, :3, :3], before.poses[0, :3, :3])  # it turns nothing
    slide = real / "dataset_0"
    slide.mkdir()
    for name in ("heights", "masks", "synced_data.npy"):
        (real / name).rename(slide / name)
    moved = say(slide, alignment="alignment.npy", **options).touches  # it lies one folder up, as in the data set
    np.testing.assert_array_equal(moved[-1].points, after.points)
    np.save(slide / "alignment.npy", 2 * alignment)
    assert "alignment.npy: its last row" in say_why(slide, alignment="alignment.npy", **options)


def say_why(folder, **options):
    with pytest.raises(UserError) as caught:
        say(folder, **options)
    return str(caught.value)


def test_hostile_files_are_refused_and_not_run(simulated, real):
    data = {"camposes": poses(1), "mNoise": Hostile(simulated / "bad")}
    (simulated / "tactile_data.pkl").write_bytes(pickle.dumps(data))
    with pytest.raises(UserError, match=r"tactile_data\.pkl asks to run `posix\.system`"):
        say(simulated)
    np.save(real / "synced_data.npy", np.array(data, dtype=object))
    with pytest.raises(UserError, match=r"synced_data\.npy asks to run `posix\.system`"):
        say(real, kind="real", heights="heights", masks="masks")
    assert not (simulated / "bad").exists()


def test_missing_files_are_named(tmp_path):
    with pytest.raises(UserError, match=r"tactile_data\.pkl cannot be read: No such file"):
        say(tmp_path)
    with pytest.raises(UserError, match=r"synced_data\.npy cannot be read: No such file"):
        say(tmp_path, kind="real", heights="heights", masks="masks")
