"""PTS: the columns that the format defines, and counts of points."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from tests.clouds.reading import read_cloud_bytes, read_with_notes


def read(text):
    return read_with_notes(text, ".pts")


@pytest.mark.parametrize(
    ("row", "columns"),
    [
        ("1 2 3", {}),
        ("1 2 3 -800", {"intensity": -800}),
        ("1 2 3 9 8 7", {"red": 9, "green": 8, "blue": 7}),
        ("1 2 3 0.5 9 8 7", {"intensity": 0.5, "red": 9, "green": 8, "blue": 7}),
        (
            "1 2 3 5 9 8 7 0 0.6 0.8",
            {"intensity": 5, "red": 9, "green": 8, "blue": 7, "nx": 0, "ny": 0.6, "nz": 0.8},
        ),
        ("1 2 3 4 5", {"c3": 4, "c4": 5}),
    ],
)
@pytest.mark.parametrize("head", ["", "2\n", " 2 \r\n", "# scan\n2\n"])
def test_the_number_of_columns_says_what_they_are(row, columns, head):
    cloud, said = read(f"{head}{row}\n{row}\n")
    assert cloud.points.tolist() == [[1, 2, 3]] * 2
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {n: [v] * 2 for n, v in columns.items()}
    assert all(cloud.columns[name].dtype == np.uint8 for name in ("red", "green", "blue") if name in columns)
    assert said == []


def test_scans_follow_one_another_with_a_count_each():
    cloud, said = read("2\n1 2 3 7\n4 5 6 8\n1\n7 8 9 9\n")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert cloud.columns["intensity"].tolist() == [7, 8, 9]
    assert said == []


def test_counts_are_compared_with_the_points():
    with pytest.raises(UserError, match="cut off: 2 of its 3 points are there"):
        read("3\n1 2 3\n4 5 6\n")
    assert read("1\n1 2 3\n4 5 6\n")[1] == ["it counts 1 points and holds 2"]


def test_what_is_written_is_read_again():
    colours = {name: np.array([0, 7, 255], np.uint8) for name in ("red", "green", "blue")}
    points = np.array([[0.1, -0.0, 1e-300], [1, 2, 3], [500_000.123456789, 1, 2]])
    data = cloud_bytes(Cloud(points, {**colours, "Intensity": np.array([1.5, 2, 3])}), ".pts")
    assert data.decode().splitlines()[:2] == ["3", "0.1 -0.0 1e-300 1.5 0 0 0"]
    cloud, _ = read(data.decode())
    assert cloud.points.tobytes() == points.tobytes()
    assert list(cloud.columns) == ["intensity", "red", "green", "blue"]
    assert cloud_bytes(cloud, ".pts") == data


@pytest.mark.parametrize(
    ("colour", "expected"),
    [
        (np.array([0, 0.5, 1]), [0, 128, 255]),
        (np.array([0, 65535, 257], np.uint16), [0, 255, 1]),
        (np.array([0.0, 255, 17]), [0, 255, 17]),
        (np.array([0, 1, np.nan]), [0, 255, 0]),
    ],
)
def test_colours_are_written_from_0_to_255(colour, expected):
    cloud, _ = read(cloud_bytes(Cloud(np.eye(3), dict.fromkeys(("red", "green", "blue"), colour)), ".pts").decode())
    assert cloud.columns["red"].tolist() == expected


@pytest.mark.parametrize("names", [["label"], ["red", "green"], ["nx", "ny", "nz"]])
def test_columns_that_the_format_lacks_are_refused(names):
    with pytest.raises(UserError, match=r"a \.pts holds points, an intensity and complete colours, .*: write a \.ply"):
        cloud_bytes(Cloud(np.zeros((1, 3)), {name: np.zeros(1) for name in names}), ".pts")


@pytest.mark.parametrize("width", [4, 5, 7])
def test_given_names_replace_those_of_the_format(width):
    text = "".join(" ".join(str(start + i) for i in range(width)) + "\n" for start in (10, 20))
    cloud = read_cloud_bytes(text, ".pts", columns="-,x,y,z")
    assert cloud.points.tolist() == [[11, 12, 13], [21, 22, 23]]
    assert cloud.columns == {}
    assert read_cloud_bytes(text, ".pts", columns="x,y,z").columns == {}
