import json

import numpy as np
import pytest

from pcsr import PoseError, UserError
from pcsr.clouds.formats import write_points
from pcsr.recorded import read
from pcsr.recorded.layouts.gsrobotics import Options
from tests.recorded.pressed import PITCH, pressed
from tests.sensors.other_programs import gs_sdk, gsrobotics

STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}


def pixels(sign=1):
    """A cloud of every pixel, in pixels: 6 x 4, with two that press in."""
    v, u = np.mgrid[:4, :6].astype(float)
    z = np.zeros((4, 6))
    z[0, 5], z[2, 1] = 20, 10
    return np.stack([u, v, sign * z], axis=-1).reshape(-1, 3)


def say(folder, **options):
    layout = {
        "name": "gsrobotics",
        "mm_per_pixel": 0.1,
        "indentation": "positive",
        "contact_above": 0.5,
        "integration": "exact",
        "poses": {"1": STILL},
        "unit": "mm",
        "object_unit": "mm",
    }
    (folder / "touches.json").write_text(json.dumps({"format": 1, "layout": layout | options}))
    return read(folder)


@pytest.mark.parametrize(("sign", "word"), [(1, "positive"), (-1, "negative")])
def test_pixels_become_millimetres_above_the_middle_of_the_gel(tmp_path, sign, word):
    write_points(tmp_path / "pc_1.pcd", pixels(sign))
    recording = say(tmp_path, indentation=word)
    assert recording.names == ["pc_1.pcd"]
    (touch,) = recording.touches
    np.testing.assert_allclose(touch.points, [[0.25, 0.15, 2], [-0.15, -0.05, 1]])
    assert touch.contact_area == pytest.approx(0.02)
    assert (touch.unit, touch.sensor) == (1.0, "gelsight-mini")
    np.testing.assert_array_equal(touch.poses[0], np.eye(4))


def test_poses_carry_the_frame_and_unit_of_the_object(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    poses = {"1": STILL | {"translation": [1, 2, 3]}}
    (touch,) = say(tmp_path, poses=poses, unit="cm", object_unit="m", sensor="mine").touches
    np.testing.assert_allclose(touch.points, np.array([[10.25, 20.15, 32], [9.85, 19.95, 31]]) / 1000)
    assert touch.sensor == "mine"


def test_the_sensor_may_look_along_another_axis(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    (touch,) = say(tmp_path, axes="+z").touches
    np.testing.assert_allclose(touch.points, [[0.25, -0.15, -2], [-0.15, 0.05, -1]])


def test_contact_begins_where_it_is_said(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    assert len(say(tmp_path, contact_above=1.5).touches[0].points) == 1
    with pytest.raises(UserError, match=r"pc_1\.pcd: no contact: none of the 24 pixels is in contact"):
        say(tmp_path, contact_above=2.5)
    write_points(tmp_path / "pc_1.pcd", pixels()[1:])  # no whole image
    (touch,) = say(tmp_path, contact_above=0.5).touches
    np.testing.assert_allclose(touch.points, [[0.25, 0.15, 2], [-0.15, -0.05, 1]])
    with pytest.raises(UserError, match=r"pc_1\.pcd: no contact: none of its 23 points is above 2.5 mm"):
        say(tmp_path, contact_above=2.5)


def test_clouds_and_poses_belong_together_by_number(tmp_path):
    for number in (1, 2, 10, 3):
        write_points(tmp_path / f"pc_{number}.pcd", pixels())
    (tmp_path / "pc_last.pcd").write_text("of another program")
    (tmp_path / "pointcloud_4.pcd").write_bytes((tmp_path / "pc_1.pcd").read_bytes())
    bad = STILL | {"quaternion": [0, 0, 0, 3]}
    recording = say(tmp_path, poses={"10": STILL, "2": STILL, "7": STILL, "3": bad, "4": STILL})
    assert recording.names == ["pc_2.pcd", "pointcloud_4.pcd", "pc_10.pcd"]
    assert list(recording.skipped) == ["pc_3.pcd", "pc_7.pcd", "pc_1.pcd"]
    assert "no pose for the number in its name: add it, if it is a touch" in recording.skipped["pc_1.pcd"]
    assert "its norm is 3" in recording.skipped["pc_3.pcd"]
    assert "does not exist" in recording.skipped["pc_7.pcd"]


def test_frames_without_a_pose_are_named_together(tmp_path):
    for number in range(12):
        write_points(tmp_path / f"pc_{number}.pcd", pixels())
    recording = say(tmp_path)
    assert list(recording.skipped) == ["pc_0.pcd (and 10 more)"]


def test_a_number_that_two_files_have_is_that_of_neither(tmp_path):
    for name in ("pc_1.pcd", "pointcloud_1.pcd"):
        write_points(tmp_path / name, pixels())
    with pytest.raises(UserError, match=r"layout\.poses\.1 may be that of pc_1\.pcd or pointcloud_1\.pcd: name the"):
        say(tmp_path)
    recording = say(tmp_path, poses={"pointcloud_1.pcd": STILL})
    assert recording.names == ["pointcloud_1.pcd"]
    assert list(recording.skipped) == ["pc_1.pcd"]


def saved(path, heights):
    """Write heights in pixels as the program does."""
    v, u = np.mgrid[: heights.shape[0], : heights.shape[1]]
    write_points(path, np.stack([u, v, heights], axis=-1).reshape(-1, 3).astype(float))


@pytest.mark.parametrize(("integration", "integrate"), [("gsrobotics", gsrobotics), ("gs_sdk", gs_sdk)])
def test_heights_are_corrected_for_the_integration_of_the_program(tmp_path, integration, integrate):
    indentation, contact = pressed(0.2, middle=(30, 40), shape=(60, 80))
    slopes = np.stack(np.gradient(indentation / PITCH)[::-1], axis=-1)
    saved(tmp_path / "pc_1.pcd", integrate(slopes))
    options = {"mm_per_pixel": PITCH, "contact_above": None, "integration": integration}
    (touch,) = say(tmp_path, **options).touches
    assert touch.points[:, 2].max() == pytest.approx(0.2, rel=0.08)
    assert len(touch.points) == pytest.approx(contact.sum(), rel=0.05)
    assert touch.contact_area == pytest.approx(contact.sum() * PITCH**2, rel=0.05)
    assert touch.view == (80 * PITCH, 60 * PITCH)
    (wrong,) = say(tmp_path, **options | {"integration": "exact"}).touches
    assert wrong.points[:, 2].max() != pytest.approx(0.2, rel=0.1)
    assert Options.model_fields["integration"].default == "gsrobotics"


def test_only_whole_images_can_be_corrected(tmp_path):
    for cloud in (pixels()[1:], pixels() + np.eye(3)[1], pixels() * 1.5, np.repeat(pixels()[:1], 24, axis=0)):
        write_points(tmp_path / "pc_1.pcd", cloud)
        for options in ({"integration": "gsrobotics"}, {"contact_above": None}):
            with pytest.raises(UserError, match=r'points are not one for each pixel of an image.*give "integration"'):
                say(tmp_path, **options)


def test_pixels_per_mm_are_named(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    with pytest.raises(UserError, match=r"18\.6 looks like pixels per mm"):
        say(tmp_path, mm_per_pixel=18.6)


def test_a_damaged_cloud_is_left_out(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    (tmp_path / "pc_2.pcd").write_text("noise")
    recording = say(tmp_path, poses={"1": STILL, "2": STILL})
    assert recording.names == ["pc_1.pcd"]
    assert "pc_2.pcd: it cannot be read as a .pcd file" in recording.skipped["pc_2.pcd"]


def test_a_folder_without_clouds_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"holds no pc_<n>\.pcd or pointcloud_<n>\.pcd"):
        say(tmp_path)


@pytest.mark.parametrize("key", ["mm_per_pixel", "indentation", "poses", "unit", "object_unit"])
def test_what_nobody_can_guess_must_be_said(tmp_path, key):
    with pytest.raises(UserError, match=rf"layout\.{key}"):
        say(tmp_path, **{key: None})


def test_a_mistake_in_a_pose_is_named_with_its_number(tmp_path):
    with pytest.raises(UserError, match=r"layout\.poses\.4\.order: it must be 'xyzw' or 'wxyz', got 'xyz'"):
        say(tmp_path, poses={"4": STILL | {"order": "xyz"}})


def test_the_error_of_the_poses_is_beside_the_layout(tmp_path):
    write_points(tmp_path / "pc_1.pcd", pixels())
    say(tmp_path)
    manifest = json.loads((tmp_path / "touches.json").read_text())
    manifest["pose_error"] = {"position": 0.3, "rotation": 1}
    (tmp_path / "touches.json").write_text(json.dumps(manifest))
    assert read(tmp_path).pose_error == PoseError(0.3, 1.0)
    assert say(tmp_path).pose_error is None
