from io import BytesIO

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from pcsr.clouds.formats.colours import brightest, in_bytes
from tests.clouds.reading import read_cloud_bytes

NAMES = ("red", "green", "blue")
POINTS = np.zeros((3, 3)) + np.arange(3)[:, None]


def named(values, names=NAMES):
    return dict.fromkeys(names, np.asarray(values))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.array([0, 128, 255], "u1"), [0, 128, 255]),
        (np.array([0.0, 0.5, 1.0]), [0, 128, 255]),
        (np.array([0.0, 127.6, 255.0], "f4"), [0, 128, 255]),
        (np.array([0, 128 * 257, 65535], "u2"), [0, 128, 255]),
        (np.array([0, 128 * 256, 255 * 256], "u2"), [0, 128, 255]),
        (np.array([0, 128, 255], "u2"), [0, 128, 255]),
        (np.array([0, 128, 255], "i8"), [0, 128, 255]),
    ],
)
def test_colours_of_every_range_become_bytes(values, expected):
    for names in (NAMES, ("R", "G", "B"), ("Red", "Green", "Blue")):
        found = in_bytes(named(values, names))
        assert list(found) == list(NAMES)
        assert [found[name].tolist() for name in NAMES] == [expected] * 3
        assert found["red"].dtype == np.uint8


@pytest.mark.parametrize("values", [[-1, 0, 1], [0, 1, 70000], [0, np.nan, 1], [True, False, True]])
def test_what_is_in_no_known_range_is_kept(values):
    assert brightest(named(values), list(NAMES)) is None
    assert in_bytes(named(values)).keys() == set(NAMES)
    np.testing.assert_array_equal(in_bytes(named(values))["red"], values)


def test_other_columns_are_kept_and_nothing_is_overwritten():
    columns = {"label": np.array([1, 2, 300]), **named(np.array([0.0, 0.5, 1]), ("r", "g", "b")), "green": np.ones(3)}
    found = in_bytes(columns)
    assert found["label"] is columns["label"]
    assert len(found) == len(columns)


@pytest.mark.parametrize("suffix", [".obj", ".npz", ".xyz", ".pcd", ".las"])
def test_a_ply_gets_bytes_whatever_the_colours_came_from(suffix):
    colours = named(np.array([0, 51, 255], "u1"))
    there = read_cloud_bytes(cloud_bytes(Cloud(POINTS, colours), suffix), suffix)
    data = cloud_bytes(there, ".ply")
    assert all(f"property uchar {name}\n".encode() in data for name in NAMES)
    again = read_cloud_bytes(data, ".ply")
    assert [again.columns[name].tolist() for name in NAMES] == [[0, 51, 255]] * 3


@pytest.mark.parametrize(("kind", "name"), [("f4", "float"), ("u2", "ushort"), ("f8", "double")])
def test_a_ply_keeps_the_colours_that_it_came_with(kind, name):
    lines = "".join(f"property {name} {colour}\n" for colour in NAMES)
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
    )
    rows = np.zeros(2, [("xyz", "<f4", 3), ("rgb", f"<{kind}", 3)])
    rows["rgb"] = [[0, 1, 0], [1, 0, 1]]
    data = (head + lines + "end_header\n").encode() + rows.tobytes()
    assert cloud_bytes(read_cloud_bytes(data, ".ply"), ".ply") == data


def test_las_stays_las():
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=7, version="1.4")
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    las.red, las.green, las.blue = [0, 1, 65535], [255, 256, 257], [7, 8, 9]
    file = BytesIO()
    las.write(file)
    cloud = read_cloud_bytes(file.getvalue(), ".las")
    again = read_cloud_bytes(cloud_bytes(cloud, ".las"), ".las")
    for name in NAMES:
        assert again.columns[name].dtype == np.uint16
        np.testing.assert_array_equal(again.columns[name], las[name])
    assert b"FIELDS x y z " in (data := cloud_bytes(cloud, ".pcd"))
    assert b" rgb" in data[:300]
