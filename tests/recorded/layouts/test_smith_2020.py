import json
import os
import re

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


POSITIONS = [np.array([0.1 * k, 0.2, 0.7]) for k in range(4)]
ANGLES = [np.array([0.1, 0.2, 0.3 * k]) for k in range(4)]


def ahead(finger, count=5):
    """Points that lie before a finger, in the world: it looks along its own +x."""
    local = np.random.default_rng(finger).uniform(-0.008, 0.008, (count, 3))
    local[:, 0] = 0.01
    return Rotation.from_euler("xyz", ANGLES[finger]).apply(local) + POSITIONS[finger]


def grasp(**changes):
    data = {
        "cam_pos": POSITIONS,
        "cam_rot": ANGLES,
        "touch_success": [True, False, True, True],
        "depth": [np.ones((100, 100))] * 4,
        "gel": [np.zeros((4, 4, 3))] * 4,
        "points": [ahead(0), np.zeros((0, 3)), ahead(2, 7), []],
    }
    return data | changes


def save(folder, name, data):
    np.save(folder / f"{name}.npy", np.array(data, dtype=object))


def say(folder, **options):
    layout = {"name": "smith-2020", **options}
    (folder / "touches.json").write_text(json.dumps({"format": 1, "layout": layout}))
    return read(folder)


def test_a_grasp_is_the_union_of_the_fingers_that_touched(tmp_path):
    save(tmp_path, 0, grasp())
    recording = say(tmp_path)
    assert recording.names == ["0"]
    (touch,) = recording.touches
    assert touch.finger.tolist() == [0] * 5 + [1] * 7
    assert (touch.unit, touch.sensor, touch.contact_area) == (500.0, "smith-2020", None)
    # The object's own frame is twice as large, and 0.6 m lower.
    np.testing.assert_allclose(touch.points * 0.5 + [0, 0, 0.6], np.concatenate([ahead(0), ahead(2, 7)]))


def test_poses_map_what_lies_before_a_finger(tmp_path):
    save(tmp_path, 0, grasp())
    (touch,) = say(tmp_path).touches
    for finger in (0, 1):
        points = touch.points[touch.finger == finger]
        inverse = np.linalg.inv(touch.poses[finger])
        local = points @ inverse[:3, :3].T + inverse[:3, 3]
        np.testing.assert_allclose(local[:, 2], -10)  # 10 mm ahead, and a sensor looks along -z
        assert np.abs(local[:, :2]).max() < 8


def test_each_finger_may_be_a_touch(tmp_path):
    save(tmp_path, 0, grasp())
    recording = say(tmp_path, per="finger")
    assert recording.names == ["0/0", "0/2"]
    assert [len(touch.points) for touch in recording.touches] == [5, 7]
    assert recording.skipped == dict.fromkeys(["0/1", "0/3"], "this finger has no contact")


def test_grasps_come_in_the_order_of_their_numbers(tmp_path):
    for number in (10, 2, 0):
        save(tmp_path, number, grasp())
    save(tmp_path, "first", grasp(touch_success=[False] * 4))
    recording = say(tmp_path)
    assert recording.names == ["0", "2", "10"]
    assert recording.skipped == {"first": "none of its 4 fingers has any contact"}


def test_a_hostile_file_is_left_out_and_not_run(tmp_path):
    save(tmp_path, 0, grasp())
    save(tmp_path, 1, grasp(gel=Hostile(tmp_path / "bad")))
    recording = say(tmp_path)
    assert recording.names == ["0"]
    assert "1.npy asks to run `posix.system`, which a data file has no need for" in recording.skipped["1"]
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ([1, 2], "has no cam_pos, cam_rot, touch_success, points: it is not a grasp"),
        ({"points": []}, "has no cam_pos, cam_rot, touch_success: it is not a grasp"),
        (grasp(points=[ahead(0)]), "4 cam_pos, 4 cam_rot, 4 touch_success, 1 points"),
        (grasp(points=3), "must be lists, one item for each finger"),
        (grasp(points=[np.ones((2, 2))] * 4), r"finger 0: points must have shape \(n, 3\)"),
        (grasp(points=[ahead(0) * np.nan] * 4), "finger 0: points: 15 of 15 numbers are not finite"),
        (grasp(points=[[[1], [1, 2]]] * 4), "finger 0: points holds no array"),
        (grasp(points=[["a"]] * 4), "finger 0: points holds <U1, not numbers"),
        (grasp(cam_rot=[np.eye(3)] * 4), r"finger 0: cam_rot must have shape \(3\)"),
        (grasp(cam_pos=[[np.inf, 0, 0]] * 4), "finger 0: cam_pos: 1 of 3 numbers are not finite"),
        (grasp(touch_success=["yes"] * 4), "finger 0: touch_success must be true or false, got 'yes'"),
    ],
)
def test_what_is_no_grasp_is_left_out(tmp_path, data, reason):
    save(tmp_path, 0, grasp())
    file = np.array(None, dtype=object)
    file[()] = data
    np.save(tmp_path / "1.npy", file)
    recording = say(tmp_path)
    assert recording.names == ["0"]
    assert re.search(reason, recording.skipped["1"])


def test_a_folder_without_grasps_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"holds no <grasp>\.npy: give the folder of one object"):
        say(tmp_path)
    with pytest.raises(UserError, match=r"layout\.per: it must be 'grasp' or 'finger', got 'hand'"):
        say(tmp_path, per="hand")
