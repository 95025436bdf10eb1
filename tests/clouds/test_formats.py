import os
import pickle  # noqa: TID251

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pcsr import UserError
from pcsr.clouds.formats import CLOUD_WRITERS, read_points, write_points

WRITERS = [suffix for suffix in CLOUD_WRITERS if suffix not in (".las", ".laz")]  # these round
POINTS = np.array([[1.0, 2.0, 3.0], [0.1, -0.0, 1e-320], [1e300, -7.25, 1 / 3]])
PLY = "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
PCD = (
    "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\n"
    "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA ascii\n"
)


def read(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_points(path)


@pytest.mark.parametrize("suffix", WRITERS)
@given(points=arrays.arrays(np.float64, (5, 3), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_every_format_keeps_every_double(tmp_path_factory, suffix, points):
    path = tmp_path_factory.getbasetemp() / f"cloud{suffix}"
    write_points(path, points)
    again = read_points(path)
    assert again.dtype == np.float64
    assert again.tobytes() == points.tobytes()


def test_suffixes_in_capitals_count_and_one_point_is_a_cloud(tmp_path):
    for suffix in WRITERS:
        write_points(tmp_path / f"one{suffix.upper()}", POINTS[:1])
        assert read_points(tmp_path / f"one{suffix.upper()}").tolist() == [[1, 2, 3]]


def test_views_and_single_precision_are_written_as_they_stand(tmp_path):
    for suffix in WRITERS:
        write_points(tmp_path / f"a{suffix}", POINTS[::-1, ::-1])
        np.testing.assert_array_equal(read_points(tmp_path / f"a{suffix}"), POINTS[::-1, ::-1])
        write_points(tmp_path / f"a{suffix}", POINTS[:1].astype(np.float32))
        np.testing.assert_array_equal(read_points(tmp_path / f"a{suffix}"), POINTS[:1])


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.xyz", "1 2 3\n4\t5  6\n", [[1, 2, 3], [4, 5, 6]]),
        ("a.xyz", "# from a scanner\n// and more\n\n1,2,3,255,0,0\n4, 5, 6, 0, 0, 0\n", [[1, 2, 3], [4, 5, 6]]),
        ("a.txt", "X Y Z nx\n1 2 3 9\n", [[1, 2, 3]]),
        ("a.txt", "nx x y z\n9 1 2 3\n", [[1, 2, 3]]),
        ("a.txt", "east north up\n1 2 3\n", [[1, 2, 3]]),
        ("a.txt", b"\xef\xbb\xbf1 2 3\r\n4 5 6\r\n", [[1, 2, 3], [4, 5, 6]]),
        ("a.csv", "x,y,z\n1,2,3\n", [[1, 2, 3]]),
        ("a.csv", '"time", "Z", "X", "Y"\n0, 3, 1, 2\n', [[1, 2, 3]]),
        ("a.csv", "1,2,3,9\n4,5,6,9\n", [[1, 2, 3], [4, 5, 6]]),
        ("a.ply", PLY.format(n=2) + "1 2 3\n1 2 3\n", [[1, 2, 3], [1, 2, 3]]),
        ("a.pcd", PCD.format(n=2) + "1 2 3 7\n4 5 6 7\n", [[1, 2, 3], [4, 5, 6]]),
        ("a.pcd", PCD.format(n=1) + "1 2 3 7\n", [[1, 2, 3]]),
    ],
)
def test_what_other_programs_write_is_read(tmp_path, name, content, expected):
    assert read(tmp_path, name, content).tolist() == expected


def test_a_mesh_gives_all_its_vertices(tmp_path):
    box = trimesh.creation.box()
    mesh = trimesh.Trimesh(np.vstack([box.vertices, [[9, 9, 9]], box.vertices[:1]]), box.faces, process=False)
    for encoding in ("ascii", "binary"):
        mesh.export(tmp_path / "mesh.ply", encoding=encoding)
        np.testing.assert_allclose(read_points(tmp_path / "mesh.ply"), mesh.vertices)


def test_arrays_of_any_numbers_with_more_columns_are_read(tmp_path):
    for dtype in (np.float32, ">f8", np.int16, np.uint8):
        np.save(tmp_path / "a.npy", np.arange(12).reshape(2, 6).astype(dtype))
        assert read_points(tmp_path / "a.npy").tolist() == [[0, 1, 2], [6, 7, 8]]


def test_an_npz_gives_its_points_or_its_only_array(tmp_path):
    np.savez(tmp_path / "a.npz", other=POINTS + 1, points=POINTS)
    assert read_points(tmp_path / "a.npz").tobytes() == POINTS.tobytes()
    np.savez(tmp_path / "a.npz", touched=POINTS)
    assert read_points(tmp_path / "a.npz").tobytes() == POINTS.tobytes()
    np.savez(tmp_path / "a.npz", point=POINTS, touched=POINTS)
    with pytest.raises(UserError, match="holds 2 arrays, none of them 'points': did you mean 'point'"):
        read_points(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.xyz", "1 2 3\n4 5\n", "line 2 has 2 columns, at least 3 are needed"),
        ("a.xyz", "1000\n1 2 3\n", "cut off: 1 of its 1000 points are there"),
        ("a.xyz", "1 2 3\n\n4 five 6\n", r"line 3, column 2 \(y\): 'five' is no number"),
        ("a.xyz", "1 2 nan\n1 2 3\ninf 2 3\n", "2 of 3 points have a coordinate that is not finite"),
        ("a.xyz", "# nothing\nx y z\n", "holds no points"),
        ("a.xyz", b"\xff\xfe\x00", "begins as UTF-16-LE text, and byte 2 is no character of it: it is cut off"),
        ("a.csv", "a,b,c\n1,2,3\n", "its columns are a, b, c: name those of the coordinates x, y and z"),
        ("a.csv", "1;2\n", "line 1 has 2 columns, at least 3 are needed"),
        ("a.csv", "t,x,y,z\n1,2,3\n", "line 2 has 3 columns, at least 4"),
        ("a.ply", "", "cannot be read as a .ply file"),
        ("a.ply", "ply noise", "cannot be read as a .ply file"),
        ("a.ply", PLY.format(n=0), "holds no points"),
        ("a.ply", PLY.format(n=3) + "1 2 3\n4 5 6\n", "cut off: 2 of its 3 points are there"),
        ("a.ply", PLY.format(n=2) + "1 2 nan\n4 5 6\n", "1 of 2 points have a coordinate that is not finite"),
        ("a.ply", PLY.format(n=1).replace("float z", "float w") + "1 2 3\n", "cannot be read as a .ply file: 'z'"),
        ("a.pcd", "", "cannot be read as a .pcd file"),
        ("a.pcd", PCD.format(n=3) + "1 2 3 7\n4 5 6 7\n", "cut off: 2 of its 3 points are there"),
        ("a.pcd", PCD.format(n=1).replace("x y z", "u v z") + "1 2 3 7\n", "has no field x, y, only u, v, z, rgb"),
        ("a.npy", "noise", "cannot be read as a .npy file"),
        ("a.npz", "noise", "cannot be read as a .npz file"),
    ],
)
def test_a_useless_file_is_named_with_the_reason(tmp_path, name, content, reason):
    with pytest.raises(UserError, match=reason) as caught:
        read(tmp_path, name, content)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".npz"])
def test_a_binary_file_that_is_cut_off_is_refused(tmp_path, suffix):
    write_points(tmp_path / f"a{suffix}", POINTS)
    whole = (tmp_path / f"a{suffix}").read_bytes()
    for length in range(len(whole)):
        with pytest.raises(UserError):
            read(tmp_path, f"b{suffix}", whole[:length])


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (np.zeros((0, 3)), "holds no points"),
        (np.zeros((4, 2)), r"shape \(4, 2\): points are \(n, 3\)"),
        (np.zeros(3), r"shape \(3,\)"),
        (np.array([["a", "b", "c"]]), "points are real numbers"),
        (np.ones((2, 3), complex), "points are real numbers"),
        (np.zeros(2, [("x", "f8")]), "points are real numbers"),
    ],
)
def test_arrays_that_are_no_points_are_refused(tmp_path, array, reason):
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", points=array)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(UserError, match=reason):
            read_points(tmp_path / name)


class Hostile:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def test_arrays_of_objects_are_refused_and_not_run(tmp_path):
    array = np.array([Hostile(tmp_path / "bad")])
    assert pickle.dumps(array)
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", points=array)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(UserError, match="holds items of dtype object"):
            read_points(tmp_path / name)
    assert not (tmp_path / "bad").exists()


def test_unknown_suffixes_name_the_known_ones(tmp_path):
    for use in (read_points, lambda path: write_points(path, POINTS)):
        with pytest.raises(UserError, match=r"no cloud format '.abc': .asc, .*\.ply, .*\.xyz are known"):
            use(tmp_path / "a.abc")
        with pytest.raises(UserError, match="no cloud format ''"):
            use(tmp_path / "cloud")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(UserError, match=r"none\.ply cannot be read: No such file"):
        read_points(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(UserError, match="cannot be read"):
        read_points(tmp_path / "folder.ply")


@pytest.mark.parametrize("suffix", WRITERS)
def test_points_that_could_not_be_read_again_are_not_written(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_points(path, POINTS)
    before = path.read_bytes()
    for points, reason in [(POINTS[:0], "no points"), (POINTS * np.nan, "3 of 3"), (POINTS - np.inf, "not finite")]:
        with pytest.raises(UserError, match=reason):
            write_points(path, points)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_folder_is_not_replaced(tmp_path):
    (tmp_path / "a.ply").mkdir()
    with pytest.raises(UserError, match=r"a\.ply is a folder"):
        write_points(tmp_path / "a.ply", POINTS)
