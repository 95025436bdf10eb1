import json
import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.recorded import read


class Hostile:
    """Unpickled the usual way, it writes a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


TURNED = Rotation.from_euler("xyz", [0.3, -0.2, 1.1]).as_matrix()
PLACE = np.array([0.1, -0.05, 0.2])


def ahead(distance, count=6):
    """Points in metres before a camera that looks along its own +x."""
    local = np.random.default_rng(0).uniform(-0.004, 0.004, (count, 3))
    local[:, 0] = distance
    return local @ TURNED.T + PLACE


def save(folder, action, finger, points, frame=None):
    inner = folder / str(action)
    inner.mkdir(exist_ok=True)
    if points is not None:
        np.save(inner / f"{finger}_points.npy", points)
    frame = {"pos": PLACE, "rot": TURNED} if frame is None else frame
    np.save(inner / f"{finger}_ref_frame.npy", np.array(frame, dtype=object))


def say(folder, **options):
    layout = {"name": "pterotactyl", **options}
    (folder / "touches.json").write_text(json.dumps({"format": 1, "layout": layout}))
    return read(folder)


def in_sensor(touch, finger=0):
    inverse = np.linalg.inv(touch.poses[finger])
    return touch.points[touch.finger == finger] @ inverse[:3, :3].T + inverse[:3, 3]


def test_points_stay_where_they_are_and_the_face_is_before_the_camera(tmp_path):
    save(tmp_path, 3, 1, ahead(0.02))
    recording = say(tmp_path)
    assert recording.names == ["3"]
    (touch,) = recording.touches
    np.testing.assert_array_equal(touch.points, ahead(0.02))
    assert (touch.unit, touch.sensor) == (1000.0, "smith-2021")
    np.testing.assert_allclose(in_sensor(touch)[:, 2], 12.8 - 20)  # mm, and a sensor looks along -z
    assert np.abs(in_sensor(touch)[:, :2]).max() < 4
    (touch,) = say(tmp_path, face=19.2).touches
    np.testing.assert_allclose(in_sensor(touch)[:, 2], 19.2 - 20)


def test_a_grasp_is_the_union_of_the_fingers_that_touched(tmp_path):
    for action in (10, 9):
        save(tmp_path, action, 0, ahead(0.02, 3))
        save(tmp_path, action, 1, None)
        save(tmp_path, action, 2, np.zeros((0, 3)))
        save(tmp_path, action, 3, ahead(0.01, 4))
    save(tmp_path, 11, 0, np.zeros((0, 3)))
    recording = say(tmp_path)
    assert recording.names == ["9", "10"]
    assert recording.touches[0].finger.tolist() == [0, 0, 0, 1, 1, 1, 1]
    np.testing.assert_allclose(in_sensor(recording.touches[0], 1)[:, 2], 2.8)
    assert recording.skipped == {"11": "none of its 1 fingers has any contact"}
    recording = say(tmp_path, per="finger")
    assert recording.names == ["9/0", "9/3", "10/0", "10/3"]
    assert set(recording.skipped) == {"9/1", "9/2", "10/1", "10/2", "11/0"}


@pytest.mark.parametrize("file", ["frame", "points"])
def test_a_hostile_file_is_left_out_and_not_run(tmp_path, file):
    save(tmp_path, 0, 0, ahead(0.02))
    hostile = np.array([Hostile(tmp_path / "bad")], dtype=object)
    if file == "frame":
        save(tmp_path, 1, 0, ahead(0.02), hostile[0])
    else:
        save(tmp_path, 1, 0, hostile)
    recording = say(tmp_path)
    assert recording.names == ["0"]
    assert "asks to run `posix.system`" in recording.skipped["1"]
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    ("points", "frame", "reason"),
    [
        (np.ones((4, 2)), None, "0_points.npy must have shape (n, 3)"),
        (np.full((4, 3), np.nan), None, "0_points.npy: 12 of 12 numbers are not finite"),
        (np.ones((4, 3)), {"pos": PLACE}, "0_ref_frame.npy has no pos and rot"),
        (np.ones((4, 3)), {"pos": PLACE, "rot": np.eye(4)}, "rot must have shape (3, 3)"),
        (np.ones((4, 3)), {"pos": PLACE, "rot": 2 * TURNED}, "scales by 2"),
        (np.ones((4, 3)), {"pos": PLACE, "rot": -TURNED}, "mirrors"),
    ],
)
def test_what_is_no_finger_is_left_out(tmp_path, points, frame, reason):
    save(tmp_path, 0, 0, ahead(0.02))
    save(tmp_path, 1, 0, points, frame)
    recording = say(tmp_path)
    assert recording.names == ["0"]
    assert reason in recording.skipped["1"]


def test_a_folder_without_actions_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"holds no <action>/<finger>_ref_frame\.npy"):
        say(tmp_path)
