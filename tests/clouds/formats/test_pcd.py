import warnings
from io import BytesIO

import numpy as np
import pytest
from pypcd4 import Encoding, PointCloud

from pcsr import PcsrWarning, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from tests.clouds.reading import read_cloud_bytes

ENCODINGS = ["ascii", "binary", "binary_compressed"]
POINTS = np.array([[0.5, 1, 2], [3, 4.25, 5]])
COLOURS = np.tile(np.array([[255, 0, 7], [1, 2, 3]], np.uint8), (40, 1))
PACKED = [(255 << 16) + 7, (1 << 16) + (2 << 8) + 3] * 40


def pcd(fields, sizes, types, counts, rows, data="ascii", more=""):
    n = len(rows)
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\nWIDTH {n}\n"
    head += f"HEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS {n}\nDATA {data}\n"
    return (head + "".join(f"{row}\n" for row in rows) + more).encode()


def read(data):
    return read_cloud_bytes(data, ".pcd")


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", ["rgb", "rgba"])
@pytest.mark.parametrize("kind", [np.float32, np.uint32])
def test_packed_colours_are_unpacked_and_packed_again(tmp_path, encoding, name, kind):
    packed = np.array(PACKED, np.uint32) + (np.uint32(9 << 24) if name == "rgba" else np.uint32(0))
    points = np.tile(POINTS, (40, 1))  # so many that compressing them pays
    fields = [*points.astype("f4").T, packed.view(kind), np.tile(np.array([5, -6], np.int16), 40)]
    cloud = PointCloud.from_points(fields, ("x", "y", "z", name, "label"), (*[np.float32] * 3, kind, np.int16))
    cloud.save(tmp_path / "a.pcd", Encoding(encoding))
    data = (tmp_path / "a.pcd").read_bytes()
    if encoding == "ascii":  # pypcd4 itself writes floats of few digits
        words = [str(value) for value in packed.view(kind)]
        data = data.partition(b"ascii\n")[0] + b"ascii\n"
        data += "".join(
            f"{x} {y} {z} {w} {i}\n" for (x, y, z), w, i in zip(points, words, fields[4], strict=True)
        ).encode()
    mine = read(data)
    assert mine.points.tolist() == points.tolist()
    assert list(mine.columns) == ["red", "green", "blue", *(["alpha"] if name == "rgba" else []), "label"]
    np.testing.assert_array_equal(np.stack([mine.columns[c] for c in ("red", "green", "blue")], 1), COLOURS)
    assert {column.dtype.str[1:] for column in mine.columns.values()} == {"u1", "i2"}
    assert mine.columns.get("alpha", np.full(80, 9)).tolist() == [9] * 80
    again = cloud_bytes(mine, ".pcd")
    (tmp_path / "b.pcd").write_bytes(again)
    theirs = PointCloud.from_path(tmp_path / "b.pcd")
    assert theirs.fields == ("x", "y", "z", name, "label")
    assert theirs.metadata.data == encoding
    assert theirs.metadata.size == (4, 4, 4, 4, 2)
    np.testing.assert_array_equal(theirs.pc_data[name].copy().view(np.uint32), packed)
    if name == "rgb":
        assert theirs.types[3] == kind


def test_colours_that_were_apart_stay_apart():
    data = pcd("x y z red green blue", "4 4 4 1 1 1", "F F F U U U", "1 1 1 1 1 1", ["1 2 3 4 5 6"])
    assert b"FIELDS x y z red green blue\n" in cloud_bytes(read(data), ".pcd")
    free = Cloud(read(data).points, read(data).columns)
    assert b"FIELDS x y z rgb\n" in cloud_bytes(free, ".pcd")
    wide = Cloud(free.points, {name: column.astype("u2") for name, column in free.columns.items()})
    assert b"FIELDS x y z rgb\n" in cloud_bytes(wide, ".pcd")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_fields_of_several_numbers_normals_and_padding(encoding):
    data = pcd(
        "_ x y z normal_x normal_y normal_z fpfh _",
        "1 4 4 4 4 4 4 4 4",
        "U F F F F F F F F",
        "3 1 1 1 1 1 1 2 1",
        ["0 0 0 0.5 1 2 0 0 1 7 8 0", "0 0 0 3 4.25 5 0 1 0 9 10 0"],
    )
    cloud = read(data)
    assert list(cloud.columns) == ["nx", "ny", "nz", "fpfh"]
    assert cloud.columns["fpfh"].tolist() == [[7, 8], [9, 10]]
    assert cloud.about["pcd"]["viewpoint"] == (1, 2, 3, 1, 0, 0, 0)
    about = {"pcd": {**cloud.about["pcd"], "encoding": encoding}}
    out = cloud_bytes(Cloud(cloud.points, cloud.columns, about), ".pcd")
    assert b"FIELDS x y z normal_x normal_y normal_z fpfh\nSIZE 4 4 4 4 4 4 4\n" in out
    assert b"VIEWPOINT 1.0 2.0 3.0 1.0 0.0 0.0 0.0\n" in out
    assert f"DATA {encoding}\n".encode() in out
    again = read(out)
    assert again.points.tolist() == POINTS.tolist()
    assert {name: column.tolist() for name, column in again.columns.items()} == {
        name: column.tolist() for name, column in cloud.columns.items()
    }


def test_coordinates_are_floats_only_where_nothing_is_lost():
    cloud = read(pcd("x y z", "4 4 4", "F F F", "1 1 1", ["0.5 1 2"]))
    assert b"SIZE 4 4 4\n" in cloud_bytes(cloud, ".pcd")
    for points in (cloud.points + 0.1, cloud.points + 1e300):
        out = cloud_bytes(Cloud(points, {}, cloud.about), ".pcd")
        assert b"SIZE 8 8 8\n" in out
        assert read(out).points.tobytes() == points.tobytes()


def test_names_and_types_that_pcd_lacks_take_others():
    columns = {"C2C (m)": np.ones(2, bool), "_": np.ones(2, np.float16), "a/b": np.ones(2, np.longdouble)}
    again = read(cloud_bytes(Cloud(POINTS, columns), ".pcd"))
    assert {name: column.dtype.str[1:] for name, column in again.columns.items()} == {
        "C2C__m_": "u1",
        "column": "f4",
        "a_b": "f8",
    }
    with pytest.raises(UserError, match=r"column 'none' has no numbers: a \.pcd holds no such field"):
        cloud_bytes(Cloud(POINTS, {"none": np.zeros((2, 0))}), ".pcd")


def test_what_is_missing_is_said():
    with pytest.raises(UserError, match="it has no field z, only x, y"):
        read(pcd("x y", "4 4", "F F", "1 1", ["1 2"]))
    with pytest.raises(UserError, match="its field x is there twice: its FIELDS are x y z x"):
        read(pcd("x y z x", "4 4 4 4", "F F F F", "1 1 1 1", ["1 2 3 4"]))
    with pytest.raises(UserError, match="its COUNT is 1 1 999999999: 10000 numbers for each point are the most"):
        read(pcd("x y z", "4 4 4", "F F F", "1 1 999999999", ["1 2 3"]))
    with pytest.raises(UserError, match="cut off: 1 of its 2"):
        read(pcd("x y z", "4 4 4", "F F F", "1 1 1", ["1 2 3", ""]))


@pytest.mark.parametrize(
    "head",
    [
        "# .PCD v.5\nVERSION .5\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n",
        "VERSION .6\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n",
        "COLUMNS x y z\nPOINTS 2\nDATA ascii\n",
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE f f f\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ASCII\n",
        "VERSION 0.8\r\nFIELDS X Y Z\r\nSIZE 4 4 4\r\nTYPE F F F\r\nWIDTH 2\r\nHEIGHT 1\r\nDATA ascii\r\n",
        "version .7\nfields x y z\nsize 4 4 4\ntype F F F\nwidth 1\nheight 2\npoints 2\ndata ascii\n",
    ],
)
def test_headers_of_every_age_are_read(head):
    for body in ("0.5 1 2\n3 4.25 5\n", " 0.5\t1  2 \r\n3 4.25 5"):
        cloud = read((head + body).encode())
        assert cloud.points.tolist() == POINTS.tolist()
        assert cloud.columns == {}


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_fields_without_numbers_and_fields_of_one_name_are_said(data):
    rows = ["0.5 1 2 7 8", "3 4.25 5 9 10"]
    whole = pcd("x none y z w w", "4 4 4 4 4 4", "F F F F F F", "1 0 1 1 1 1", rows)
    if data != "ascii":
        plain = pcd("x y z w v", "4 4 4 4 4", "F F F F F", "1 1 1 1 1", rows)
        about = {"pcd": {"encoding": data, "coordinates": "f4"}}
        whole = cloud_bytes(Cloud(POINTS, read(plain).columns, about), ".pcd")
        whole = whole.replace(b"x y z w v", b"x none y z w w").replace(b"SIZE 4 4 4 4 4", b"SIZE 4 4 4 4 4 4")
        whole = whole.replace(b"F F F F F", b"F F F F F F").replace(b"COUNT 1 1 1 1 1", b"COUNT 1 0 1 1 1 1")
    with pytest.warns(PcsrWarning) as said:
        cloud = read(whole)
    assert [str(one.message) for one in said] == [
        "it: its field 'none' has no numbers (COUNT 0) and was left out",
        "it: two of its fields are called 'w': the second is read as 'w_2'",
    ]
    assert cloud.points.tolist() == POINTS.tolist()
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {"w": [7, 9], "w_2": [8, 10]}


def test_a_width_that_contradicts_the_points_is_said_or_refused():
    rows = ["0.5 1 2", "3 4.25 5"]
    whole = pcd("x y z", "4 4 4", "F F F", "1 1 1", rows)
    with pytest.warns(PcsrWarning, match="its POINTS are 2 and its WIDTH × HEIGHT is 9: 2 are read, as its data have"):
        assert len(read(whole.replace(b"WIDTH 2", b"WIDTH 9"))) == 2
    with pytest.warns(PcsrWarning, match="its POINTS are 1 and its WIDTH × HEIGHT is 2: 2 are read"):
        assert len(read(whole.replace(b"POINTS 2", b"POINTS 1"))) == 2
    with pytest.raises(UserError, match="its POINTS are 3, its WIDTH × HEIGHT is 5, and its data have 2 points"):
        read(whole.replace(b"POINTS 2", b"POINTS 3").replace(b"WIDTH 2", b"WIDTH 5"))
    with pytest.warns(PcsrWarning, match="its data have 3 points and its header claims 2: the rest was left out"):
        assert len(read(whole + b"7 8 9\n")) == 2


def test_an_organised_cloud_with_nan_is_read_without_them():
    rows = ["0.5 1 2", "nan nan nan", "-nan(ind) 1.#QNAN 0", "3 4.25 5"]
    whole = pcd("x y z", "4 4 4", "F F F", "1 1 1", rows).replace(b"WIDTH 4\nHEIGHT 1", b"WIDTH 2\nHEIGHT 2")
    with pytest.raises(UserError, match="2 of 4 points have a coordinate that is not finite"):
        read(whole)
    cloud = read_cloud_bytes(whole, ".pcd", bad="drop")
    assert cloud.points.tolist() == POINTS.tolist()
    assert b"WIDTH 2\nHEIGHT 1\n" in cloud_bytes(cloud, ".pcd")


@pytest.mark.parametrize(("kind", "size"), [("f4", b"SIZE 4 4 4\n"), ("f8", b"SIZE 8 8 8\n")])
def test_arrays_are_written_in_their_precision(kind, size):
    points = np.random.default_rng(0).normal(size=(20, 3)).astype(kind)
    array, archive = BytesIO(), BytesIO()
    np.save(array, points)
    np.savez(archive, points=points)
    for file, suffix in ((array, ".npy"), (archive, ".npz")):
        written = cloud_bytes(read_cloud_bytes(file.getvalue(), suffix), ".pcd")
        assert size in written
        np.testing.assert_array_equal(read_cloud_bytes(written, ".pcd").points, points)


def test_what_was_single_is_written_as_single():
    """Decimal numbers of a PLY that declares them as single, but not metres in millions."""
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    for rows, size in (("0.1 0.2 0.3\n1 2 3.3\n", 4), ("4512345.678 0 0\n4512346.1 1 1\n", 8)):
        cloud = read_cloud_bytes((head + rows).encode(), ".ply")
        data = cloud_bytes(cloud, ".pcd")
        assert f"SIZE {size} {size} {size}\n".encode() in data
        np.testing.assert_allclose(read(data).points, cloud.points, rtol=1e-7 if size == 4 else 0)
    for about in ({"npy": {"coordinates": "f4"}}, {"kitti": {"coordinates": "f4"}}):
        assert b"SIZE 4 4 4\n" in cloud_bytes(Cloud(POINTS, {}, about), ".pcd")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_messages_are_never_those_of_pydantic_numpy_or_lzf(encoding):
    whole = cloud_bytes(Cloud(np.tile(POINTS, (40, 1)), {}, {"pcd": {"encoding": encoding}}), ".pcd")
    rng = np.random.default_rng(0)
    for _ in range(150):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            damaged[at] = rng.integers(256)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PcsrWarning)
                read(bytes(damaged))
        except UserError as error:
            message = str(error).lower()
        else:
            continue
        assert not any(
            word in message for word in ("pydantic", "validation", "dtype", "could not", "lzf", "invalid lit")
        )
