import zipfile
from io import BytesIO

import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, read_cloud
from tests.clouds.reading import read_cloud_bytes

POINTS = np.array([[0.5, 1, 2], [3, 4.25, 5]])


def npy(array):
    file = BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["<f4", ">f8", "i2", "u1"])
def test_further_columns_of_an_array_are_kept_in_its_type(kind):
    array = np.arange(10).reshape(2, 5).astype(kind)
    cloud = read_cloud_bytes(npy(array), ".npy")
    assert cloud.points.tolist() == [[0, 1, 2], [5, 6, 7]]
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {"c3": [3, 8], "c4": [4, 9]}
    assert {column.dtype for column in cloud.columns.values()} == {np.dtype(kind).newbyteorder("=")}
    again = np.load(BytesIO(cloud_bytes(cloud, ".npy")))
    assert again.dtype == np.dtype(kind).newbyteorder("=")
    np.testing.assert_array_equal(again, array)


def test_an_array_takes_doubles_where_its_own_type_would_lose_something():
    cloud = read_cloud_bytes(npy(np.zeros((2, 4), "f4")), ".npy")
    for points, columns in ((POINTS + 0.1, {}), (POINTS + 1e300, {}), (POINTS, {"c3": np.array([0.1, np.nan])})):
        again = np.load(BytesIO(cloud_bytes(Cloud(points, columns, cloud.about), ".npy")))
        assert again.dtype == np.float64
        np.testing.assert_array_equal(again, np.column_stack([points, *columns.values()]))
    kept = Cloud(POINTS, {"c3": np.array([0.5, np.nan])}, cloud.about)
    assert np.load(BytesIO(cloud_bytes(kept, ".npy"))).dtype == np.float32
    ints = read_cloud_bytes(npy(np.zeros((2, 4), "i4")), ".npy").about
    assert np.load(BytesIO(cloud_bytes(Cloud(POINTS, {"c3": kept.columns["c3"]}, ints), ".npy"))).dtype == np.float64


def test_columns_of_an_array_are_laid_side_by_side():
    columns = {"weights": POINTS[:, :2], "label": np.array([7, 8], np.uint8), "on": np.array([True, False])}
    table = np.load(BytesIO(cloud_bytes(Cloud(POINTS, columns), ".npy")))
    assert table.tolist() == [[0.5, 1, 2, 0.5, 1, 7, 1], [3, 4.25, 5, 3, 4.25, 8, 0]]


@pytest.mark.parametrize("value", [2**53 + 1, -(2**53) - 1])
def test_integers_that_doubles_do_not_hold_are_refused(value):
    with pytest.raises(UserError, match=r"large integers of column 'id': write a \.npz"):
        cloud_bytes(Cloud(POINTS, {"id": np.array([0, value])}), ".npy")
    data = cloud_bytes(Cloud(POINTS, {"id": np.array([0, value])}), ".npz")
    assert read_cloud_bytes(data, ".npz").columns["id"].tolist() == [0, value]


def test_every_array_with_a_row_for_each_point_is_a_column(tmp_path):
    np.savez_compressed(
        tmp_path / "a.npz",
        label=np.array([7, 8], ">i2"),
        points=np.column_stack([POINTS, [1, 2]]).astype("f4"),
        colors=np.zeros((2, 3), np.uint8),
        scale=np.array(3.0),
        names=np.array(["a", "b"]),
        camera=np.eye(4),
        stack=np.zeros((2, 2, 2)),
        x=np.zeros(2),
        c3=np.zeros(2),
    )
    with pytest.warns(PcsrWarning, match="a.npz: its camera, names, scale, stack, x were left out"):
        cloud = read_cloud(tmp_path / "a.npz")
    assert cloud.points.tolist() == POINTS.tolist()
    assert list(cloud.columns) == ["c3_2", "label", "colors", "c3"]
    assert cloud.columns["c3_2"].tolist() == [1, 2]
    assert cloud.columns["label"].dtype.isnative
    assert cloud.about["left out"] == ["camera", "names", "scale", "stack", "x"]


def test_an_only_array_gives_the_points(tmp_path):
    np.savez(tmp_path / "a.npz", touched=POINTS)
    assert read_cloud(tmp_path / "a.npz").points.tolist() == POINTS.tolist()


def test_names_that_numpy_itself_stumbles_over_are_columns(tmp_path):
    columns = {name: np.arange(2) for name in ("file", "allow_pickle", "arr_0", "a b", "ä")}
    (tmp_path / "a.npz").write_bytes(cloud_bytes(Cloud(POINTS, columns), ".npz"))
    assert list(read_cloud(tmp_path / "a.npz").columns) == list(columns)
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["a b"].tolist() == [0, 1]
    with pytest.raises(UserError, match="holds one array 'points', and that is of the coordinates: rename the column"):
        cloud_bytes(Cloud(POINTS, {"points": np.arange(2)}), ".npz")


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"point": POINTS, "other": POINTS}, "none of them 'points': did you mean 'point'"),
        ({"points": np.zeros((0, 3))}, "holds no points"),
        ({"points": np.zeros((2, 2))}, r"shape \(2, 2\): points are \(n, 3\)"),
        ({"points": np.zeros(3)}, r"shape \(3,\)"),
        ({"points": POINTS.astype(complex)}, "holds complex128: points are real numbers"),
        ({"points": POINTS.astype(bool)}, "holds bool"),
        ({"points": POINTS.astype(object)}, "holds items of dtype object"),
        ({"points": POINTS, "any": np.array([{}, {}])}, "holds items of dtype object"),
        ({}, "holds 0 arrays, none of them 'points': none is known"),
    ],
)
def test_what_is_wrong_with_arrays_is_said(tmp_path, arrays, reason):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(UserError, match=reason):
        read_cloud(tmp_path / "a.npz")


def test_an_archive_of_something_else_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("points", "1 2 3")
    with pytest.raises(UserError, match=r"a\.npz"):
        read_cloud(tmp_path / "a.npz")
