"""Bags of each kind: topics, messages in the order of time, and what is wrong with damaged ones."""

import sys

import numpy as np
import pytest

from pcsr import UserError
from pcsr.ros.bag import MAGIC, Bag
from pcsr.ros.point_clouds import POINT_CLOUD, coordinates, table
from tests.ros.bags import START, BagWriter

POINTS = np.arange(12.0).reshape(4, 3)


def test_without_rosbags_the_remedy_is_named(bag, monkeypatch):
    with bag:
        bag.pose("/arm", 0.0, (0, 0, 0))
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(UserError, match=r"a ROS bag needs rosbags, which is not installed: pip install 'pcsr\[ros\]'"):
        Bag([bag.path])


def test_topics_messages_and_times(any_bag):
    with any_bag:
        any_bag.cloud("/points", 1.0, POINTS, stamp=(START / 1e9) + 0.75)
        any_bag.pose("/arm", 0.5, (1, 2, 3))
        any_bag.cloud("/points", 2.0, POINTS + 1, stamp=0)
        any_bag.transform("tool", "base", 0.25)
    with Bag([any_bag.path]) as bag:
        assert [(one.name, one.count) for one in bag.topics.values()] == [("/arm", 1), ("/points", 2), ("/tf", 1)]
        assert bag.topics["/points"].type == POINT_CLOUD
        assert (bag.start, bag.end) == (START + 250_000_000, START + 2_000_000_000)
        found = list(bag.messages(["/points", "/arm"]))
        assert [message.topic for message in found] == ["/arm", "/points", "/points"]
        assert [(one.received - START) / 1e9 for one in found] == [0.5, 1, 2]
        # A stamp of 0 is none.
        assert [(one.stamp - START) / 1e9 for one in found] == pytest.approx([0.5, 0.75, 2])
        (second,) = bag.messages(["/points"], START + 1_500_000_000)
        np.testing.assert_array_equal(coordinates(table(second.content)), POINTS + 1)
        assert bag.last("/arm").content.pose.position.y == 2
        np.testing.assert_array_equal(coordinates(table(bag.last("/points").content)), POINTS + 1)
        assert [one.received for one in bag.messages(["/points"], stop=second.received)] == [found[1].received]


def test_a_file_of_ros_2_needs_no_folder_and_a_folder_no_metadata(any_bag):
    if any_bag.kind == "ros1":
        pytest.skip("bags of ROS 1 are files")
    with any_bag:
        any_bag.pose("/arm", 0.5, (1, 2, 3))
    (any_bag.path / "metadata.yaml").unlink()
    for path in (any_bag.file, any_bag.path):
        with Bag([path]) as bag:
            assert [message.content.pose.position.x for message in bag.messages(["/arm"])] == [1]


def test_several_bags_are_read_as_one(tmp_path):
    for kind, times in (("ros1", (0, 2)), ("mcap", (1, 3))):
        with BagWriter(tmp_path, kind, kind) as bag:
            for time in times:
                bag.pose("/arm", time, (time, 0, 0))
    with Bag([tmp_path / "ros1.bag", tmp_path / "mcap"]) as both:
        assert both.topics["/arm"].count == 4
        assert [message.content.pose.position.x for message in both.messages(["/arm"])] == [0, 1, 2, 3]
        assert (both.start, both.end) == (START, START + 3 * 10**9)
        assert both.last("/arm").content.pose.position.x == 3


def test_the_last_message_is_found_long_before_the_end_of_the_bag(any_bag):
    with any_bag:
        any_bag.cloud("/points", 0.0, POINTS)
        any_bag.cloud("/points", 1.0, POINTS + 1)
        any_bag.pose("/arm", 5000.0, (0, 0, 0))
    with Bag([any_bag.path]) as bag:
        assert bag.last("/points").received == START + 10**9


def test_a_topic_is_checked(any_bag):
    with any_bag:
        any_bag.pose("/arm", 0.5, (1, 2, 3))
        any_bag.add_topic("/silent", POINT_CLOUD)
    with Bag([any_bag.path]) as bag:
        assert bag.topic("arm", ["geometry_msgs/msg/PoseStamped"]).name == "/arm"
        with pytest.raises(
            UserError, match=r"has no topic /points: it has /arm \(geometry_msgs/PoseStamped\), /silent"
        ):
            bag.topic("/points", [POINT_CLOUD])
        said = r"the topic /arm has messages geometry_msgs/PoseStamped, not sensor_msgs/PointCloud2: name /silent"
        with pytest.raises(UserError, match=said):
            bag.topic("/arm", [POINT_CLOUD])
        with pytest.raises(UserError, match="not sensor_msgs/Image: no topic has these"):
            bag.topic("/arm", ["sensor_msgs/msg/Image"])
        with pytest.raises(UserError, match="the topic /silent is empty: it has no messages"):
            bag.topic("/silent", [POINT_CLOUD])


def test_a_bag_without_messages_has_empty_topics(any_bag):
    with any_bag:
        any_bag.add_topic("/silent", POINT_CLOUD)
    with Bag([any_bag.path]) as bag:
        assert (bag.start, bag.end) == (0, 0)
        assert list(bag.messages(["/silent"])) == []
        with pytest.raises(UserError, match=r"is empty|has no topic"):  # ROS 1 keeps no topic without messages
            bag.topic("/silent", [POINT_CLOUD])


def test_what_is_no_bag_is_refused(tmp_path):
    (tmp_path / "other.mcap").write_bytes(b"ply\n" * 100)
    (tmp_path / "empty.bag").write_bytes(b"")
    (tmp_path / "scan.ply").write_bytes(b"ply\n")
    (tmp_path / "SCAN.MCAP").write_bytes(MAGIC[".mcap"])
    (tmp_path / "folder").mkdir()
    for name, said in {
        "other.mcap": "is no .mcap file by its content",
        "empty.bag": "is no .bag file by its content",
        "scan.ply": "is no bag by its suffix: bags are .bag, .mcap, .db3 files",
        "folder": "is a folder without metadata.yaml, .mcap and .db3 files",
        "SCAN.MCAP": "suffixes of small letters: rename it to SCAN.mcap",
        "missing.mcap": "missing.mcap cannot be read: No such file",
    }.items():
        with pytest.raises(UserError, match=said):
            Bag([tmp_path / name])


def test_a_bag_that_is_cut_off_or_damaged_is_refused(any_bag, tmp_path):
    rng = np.random.default_rng(0)
    with any_bag:
        for number in range(20):
            any_bag.cloud("/points", number, rng.normal(size=(100, 3)))
    source = any_bag.path if any_bag.kind == "ros1" else any_bag.file
    data = source.read_bytes()
    refused = []
    for number, size in enumerate(np.linspace(20, len(data) - 1, 40).astype(int)):
        damaged = [data[:size]]
        noise = bytearray(data)
        noise[size : size + 30] = rng.bytes(30)
        damaged.append(bytes(noise))
        for kind, content in enumerate(damaged):
            path = tmp_path / f"{number}-{kind}{source.suffix}"
            path.write_bytes(content)
            try:
                with Bag([path]) as bag:
                    for message in bag.messages(["/points"]):
                        table(message.content)
            except UserError as error:
                refused.append(str(error))
    assert len(refused) > 20
    assert not [said for said in refused if "\n" in said]


def test_a_bag_of_ros_1_without_index_names_the_repair(tmp_path):
    with BagWriter(tmp_path, "ros1") as bag:
        bag.pose("/arm", 0.5, (1, 2, 3))
    data = bag.path.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    bag.path.write_bytes(data[:at] + bytes(8) + data[at + 8 :])
    with pytest.raises(UserError, match=r"is cut off or damaged, or is no bag: .* `rosbag reindex`"):
        Bag([bag.path])


def test_an_mcap_of_another_profile_is_named(bag):
    with bag:
        bag.pose("/arm", 0.5, (1, 2, 3))
    data = bag.file.read_bytes()
    assert data.count(b"\x04\0\0\0ros2") == 1
    bag.file.write_bytes(data.replace(b"\x04\0\0\0ros2", b"\x04\0\0\0ros1"))
    with pytest.raises(UserError, match="is an MCAP of another profile than ros2"):
        Bag([bag.path])


def test_messages_that_are_listed_and_not_there_are_an_error(any_bag, monkeypatch):
    with any_bag:
        any_bag.pose("/arm", 0.5, (1, 2, 3))
        any_bag.pose("/arm", 1.0, (2, 2, 3), stamp=1.0)
        any_bag.pose("/arm", 1.0, (3, 2, 3), stamp=2.0)
    with Bag([any_bag.path]) as bag:
        assert bag.first("/arm").content.pose.position.x == 1
        assert bag.first("/arm", (START + 10**9, 2 * 10**9)).content.pose.position.x == 3
        said = "the topic /arm lacks messages that the bag lists: it is damaged"
        with pytest.raises(UserError, match=said):
            bag.first("/arm", (START + 10**9, 3 * 10**9))
        monkeypatch.setattr(bag, "messages", lambda *arguments: iter(()))
        for read in (bag.first, bag.last):
            with pytest.raises(UserError, match=said):
                read("/arm")
