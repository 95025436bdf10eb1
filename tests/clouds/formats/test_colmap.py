import struct

import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.formats import read_cloud
from tests.clouds.reading import read_cloud_bytes

POINTS = np.random.default_rng(0).normal(size=(30, 3))


def points3d(tracks=True):
    """What COLMAP writes, by struct."""
    data = struct.pack("<Q", len(POINTS))
    for number, point in enumerate(POINTS):
        length = number % 5 if tracks else 0
        data += struct.pack("<Q3d3BdQ", 7 + number, *point, number, 2 * number, 255, 0.5, length)
        data += struct.pack(f"<{2 * length}I", *range(2 * length))
    return data


@pytest.mark.parametrize("name", ["points3D.bin", "POINTS3D.BIN"])
def test_its_name_is_known(tmp_path, name):
    (tmp_path / name).write_bytes(points3d())
    with pytest.warns(PcsrWarning, match="the tracks of its points, the images that show them, were left out"):
        cloud = read_cloud(tmp_path / name)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert [cloud.columns[c][3] for c in ("red", "green", "blue", "point3d_id", "error")] == [3, 6, 255, 10, 0.5]
    assert cloud.columns["red"].dtype == np.uint8


def test_points_without_tracks_are_read_from_any_name(tmp_path):
    (tmp_path / "a.dat").write_bytes(points3d(tracks=False))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.dat", "colmap").points, POINTS)


def test_what_is_cut_off_or_something_else_is_refused():
    whole = points3d()
    for length in range(1, len(whole)):
        with pytest.raises(UserError, match=r"it: it (is cut off|claims)"):
            read_cloud_bytes(whole[:length], "colmap")
    with pytest.raises(UserError, match="goes on for 3 bytes after its 30 points"):
        read_cloud_bytes(whole + b"abc", "colmap")
    with pytest.raises(UserError, match=r"claims .* points and has room for"):
        read_cloud_bytes(POINTS.astype("<f4").tobytes(), "colmap")


def test_the_format_in_text_is_read_as_text():
    cloud = read_cloud_bytes(b"# X Y Z R G B\n1 2 3 4 5 6\n", "colmap")
    assert cloud.points.tolist() == [[1, 2, 3]]
