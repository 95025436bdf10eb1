"""Clouds of ROS bags: by topic or the only one, with colours and fields, and what is said of them."""

from pathlib import Path

import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.formats import read_cloud, read_points
from pcsr.clouds.formats.format_table import format_of, named_by, without_suffix
from tests.clouds.reading import read_cloud_bytes
from tests.ros.bags import KINDS, BagWriter

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(30, 3)).astype("f4").astype("f8")


@pytest.fixture(params=KINDS)
def any_bag(request, tmp_path):
    return BagWriter(tmp_path, request.param)


@pytest.fixture
def bag(tmp_path):
    return BagWriter(tmp_path)


def test_the_only_topic_with_clouds_needs_no_name(any_bag):
    with any_bag:
        any_bag.cloud("/camera/points", 1.0, POINTS)
        any_bag.pose("/arm", 1.0, (0, 0, 0))
    for path in (any_bag.path, Path(f"{any_bag.path}:/camera/points"), Path(f"{any_bag.path}:camera/points")):
        np.testing.assert_array_equal(read_points(path), POINTS)
        assert format_of(path) == "rosbag"
        assert named_by(path)
        assert not without_suffix(path)
    if any_bag.kind != "ros1":
        np.testing.assert_array_equal(read_points(Path(f"{any_bag.file}:/camera/points")), POINTS)


def test_of_several_clouds_the_last_is_read_which_is_said(any_bag):
    with any_bag:
        for number in range(3):
            any_bag.cloud("/points", number, POINTS + number)
    with pytest.warns(PcsrWarning, match="the last of the 3 clouds of /points is read"):
        np.testing.assert_array_equal(read_points(any_bag.path), (POINTS + 2).astype("f4"))


def test_colours_normals_and_fields_become_columns(bag):
    colours = RNG.integers(0, 256, (30, 4), dtype=np.uint32)
    packed = colours[:, 3] << 24 | colours[:, 0] << 16 | colours[:, 1] << 8 | colours[:, 2]
    ring, strength, normal = np.arange(30, dtype="u2"), RNG.random(30).astype("f4"), RNG.normal(size=30).astype("f4")
    with bag:
        bag.cloud("/rgba", 0.0, POINTS, rgba=packed, ring=ring, pad=2, big=True)
        bag.cloud(
            "/rgb", 0.0, POINTS, rgb=(packed & 0xFFFFFF).view("f4"), intensity=strength, normal_x=normal, kind="f8"
        )
    cloud = read_cloud(Path(f"{bag.path}:/rgba"))
    assert list(cloud.columns) == ["red", "green", "blue", "alpha", "ring"]
    assert cloud.is_single
    np.testing.assert_array_equal(cloud.columns["ring"], ring)
    for name, column in zip(("red", "green", "blue", "alpha"), colours.T, strict=True):
        np.testing.assert_array_equal(cloud.columns[name], column)
    cloud = read_cloud(Path(f"{bag.path}:/rgb"))
    assert list(cloud.columns) == ["red", "green", "blue", "intensity", "nx"]
    assert not cloud.is_single
    np.testing.assert_array_equal(cloud.columns["blue"], colours[:, 2])
    np.testing.assert_array_equal(cloud.columns["intensity"], strength)


def test_points_that_are_nan_are_left_out_which_is_said(bag):
    points = POINTS.copy()
    points[[3, 5]] = np.nan
    points[7, 1] = np.inf
    ring = np.arange(30, dtype="u2")
    with bag:
        bag.cloud("/points", 0.0, points, ring=ring)
    with pytest.warns(PcsrWarning, match="2 of 30 points are NaN, as pixels without a measurement, and are left out"):
        cloud = read_cloud(bag.path, bad="keep")
    there = np.isfinite(points[:, 0])
    np.testing.assert_array_equal(cloud.points, points[there])
    np.testing.assert_array_equal(cloud.columns["ring"], ring[there])
    with pytest.warns(PcsrWarning), pytest.raises(UserError, match="not finite"):
        read_cloud(bag.path)


def test_several_topics_with_clouds_and_none_are_errors(bag):
    with bag:
        bag.cloud("/left/points", 0.0, POINTS)
        bag.cloud("/right/points", 0.0, POINTS)
        bag.pose("/arm", 0.0, (0, 0, 0))
    said = r"scan: it has several topics with clouds: name one, as in \S+scan:/left/points; it has /left/points \(sen"
    with pytest.raises(UserError, match=said):
        read_cloud(bag.path)
    said = rf"^{bag.path}: the topic /arm has messages geometry_msgs/PoseStamped, not sensor_msgs/PointCloud2"
    with pytest.raises(UserError, match=said):
        read_cloud(Path(f"{bag.path}:/arm"))
    with pytest.raises(UserError, match=rf"^{bag.path} has no topic /none: it has /arm"):
        read_cloud(Path(f"{bag.path}:/none"))


def test_a_bag_without_clouds_and_one_without_points_are_errors(tmp_path):
    with BagWriter(tmp_path, name="poses") as bag:
        bag.pose("/arm", 0.0, (0, 0, 0))
    with pytest.raises(UserError, match=r"poses: it has no cloud; it has /arm \(geometry_msgs/PoseStamped\)"):
        read_cloud(bag.path)
    with BagWriter(tmp_path, name="empty") as bag:
        bag.cloud("/points", 0.0, np.zeros((0, 3)))
    with pytest.raises(UserError, match="empty holds no points"):
        read_cloud(bag.path)
    with BagWriter(tmp_path, name="nan") as bag:
        bag.cloud("/points", 0.0, np.full((5, 3), np.nan))
    with pytest.raises(UserError, match="nan holds no points"):
        read_cloud(bag.path)


def test_names_of_columns_and_pipes_are_refused(bag):
    with bag:
        bag.cloud("/points", 0.0, POINTS)
    with pytest.raises(UserError, match="is a rosbag file, whose format names its columns"):
        read_cloud(bag.path, columns="x,y,z")
    for name in ("mcap", ".bag", "rosbag"):
        with pytest.raises(UserError, match=r"a bag is read by its path: name a .bag, .mcap or .db3 file"):
            read_cloud_bytes(b"\x89MCAP0\r\n", name)


def test_a_forged_number_of_points_is_refused(bag):
    with bag:
        bag.cloud("/points", 0.0, POINTS)
    data = bag.file.read_bytes()
    width = (30).to_bytes(4, "little")
    at = data.index(b"camera\0") + len(b"camera\0")
    at = data.index(width, at)
    bag.file.write_bytes(data[:at] + (2**31).to_bytes(4, "little") + data[at + 4 :])
    with pytest.raises(UserError, match=r"it claims 1 rows of 2147483648 points|is cut off or damaged"):
        read_cloud(bag.path)
