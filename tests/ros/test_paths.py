"""Paths of bags and of topics in them."""

from pathlib import Path, PureWindowsPath

import pytest

from pcsr.ros.paths import bag_and_topic, files_of, is_bag, split


@pytest.mark.parametrize("suffix", [".bag", ".mcap", ".db3", ".MCAP"])
def test_a_bag_is_known_by_its_suffix_and_its_topic_follows_a_colon(suffix):
    path = Path(f"runs/scan{suffix}")
    assert bag_and_topic(path) == (path, None)
    for written in ("/camera/points", "camera/points", "/camera/points/"):
        assert bag_and_topic(Path(f"{path}:{written}")) == (path, "/camera/points")


def test_a_colon_without_a_topic_is_of_a_bag_all_the_same():
    for written in ("scan.mcap:", "scan.mcap:/"):
        assert bag_and_topic(Path(written)) == (Path("scan.mcap"), "/")


@pytest.mark.parametrize(
    "name",
    [
        "scan.ply:",
        "scan.ply",
        "scan",
        "-",
        "C:/scan.ply",
        "a:b.ply",
        "scan.mcap.ply",
        "scan.ply:/points",
        "a" * 300,
        "a\0b",
    ],
)
def test_other_paths_are_no_bags(name):
    assert bag_and_topic(Path(name)) is None


def test_the_colon_of_a_drive_of_windows_is_none_of_a_topic():
    for name in (r"C:\scans\scan.mcap", "C:/scans/scan.ply", r"C:scan.ply"):
        assert split(PureWindowsPath(name).as_posix()) is None
    whole = PureWindowsPath(r"C:\scans\scan.mcap:/camera/points")
    assert split(whole.as_posix()) == ("C:/scans/scan.mcap", "/camera/points")
    assert split(PureWindowsPath(r"scan.mcap:\camera\points").as_posix()) == ("scan.mcap", "/camera/points")


def test_a_folder_is_a_bag_if_it_has_files_of_ros_2(tmp_path):
    assert not is_bag(tmp_path)
    (tmp_path / "1.mcap").touch()
    (tmp_path / "0.mcap").touch()
    assert is_bag(tmp_path)
    assert files_of(tmp_path) == [tmp_path / "0.mcap", tmp_path / "1.mcap"]
    assert bag_and_topic(Path(f"{tmp_path}:/points")) == (tmp_path, "/points")
    (tmp_path / "metadata.yaml").touch()
    assert files_of(tmp_path) == [tmp_path]


def test_a_file_whose_name_has_a_colon_is_that_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = Path("scan.mcap:points")
    assert bag_and_topic(path) == (Path("scan.mcap"), "/points")
    path.touch()
    assert bag_and_topic(path) is None
