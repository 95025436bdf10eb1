"""Recordings that are read: clouds, images and grasps at their poses."""

import re

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import pcsr
from pcsr.clouds.formats import write_points
from pcsr.recorded import MANIFEST, read, write
from tests.recorded.recordings import CLOUD, STILL, one_touch, only, reason, record


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


def test_a_height_image_is_placed_by_its_pose(folder):
    levels = np.zeros((5, 7), np.uint16)
    levels[1, 5] = 300
    levels[4, 0] = 200
    levels[0, 0] = 100
    Image.fromarray(levels).save(folder / "3.png")
    Image.fromarray(np.full((5, 7), 2, np.uint8)).save(folder / "bg.png")
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
    touch = only(folder, entry | {"background": "bg.png", "contact_above": 0.98}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[1, 0.5, 12.98], [-1.5, -1, 11.98]])
    touch = only(folder, entry | {"mask": "mask.png"}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[-1.5, 1, 11], [1, 0.5, 13]])
    np.save(folder / "3.npy", -levels.astype(np.float32))
    touch = only(folder, entry | {"height": "3.npy", "indentation": "negative"}, object_unit="mm")
    np.testing.assert_allclose(touch.points, [[-1.5, 1, 11], [1, 0.5, 13], [-1.5, -1, 12]], rtol=1e-6)
    assert "no contact: none of the 35 pixels" in reason(folder, entry | {"indentation": "negative"})


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
        ([{"cloud": None, "pose": STILL}], "none of its fingers has any contact"),
        ([{"fingers": [{"cloud": "0.npy"}]}], "fingers.0: it has none of the keys cloud, height, depth"),
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
    assert "order: it must contain the index of each of the 2 points once" in text


def test_a_recording_is_found_by_text_and_by_its_manifest_too(tmp_path):
    write(tmp_path, [one_touch()])
    for place in (str(tmp_path), tmp_path / MANIFEST, str(tmp_path / MANIFEST)):
        assert np.array_equal(read(place).touches[0].points, read(tmp_path).touches[0].points)


def test_a_view_in_metres_is_named(tmp_path):
    x, y = np.meshgrid(np.linspace(-6, 6, 9), np.linspace(-4, 4, 9))
    points = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    touches = [pcsr.Touch.single(points, np.eye(4), 1.0, "pad", view=view) for view in ((16.0, 12.0), (0.016, 0.012))]
    write(tmp_path / "touches", touches)
    recording = read(tmp_path / "touches")
    assert [touch.view for touch in recording.touches] == [(16.0, 12.0)]
    assert "0.016 × 0.012 mm, but its points are 12 × 8 mm wide" in recording.skipped["1.ply"]
