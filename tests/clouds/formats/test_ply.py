import numpy as np
import pytest
import trimesh

from pcsr import PcsrWarning, UserError
from pcsr.clouds.formats import cloud_bytes
from tests.clouds.reading import read_cloud_bytes

FULL = (
    "ply\nformat {encoding} 1.0\ncomment by hand: ä\nobj_info scan 7\n"
    "element camera 2\nproperty float focus\nproperty list uchar int pixels\n"
    "element vertex 3\nproperty float x\nproperty uchar red\nproperty float y\nproperty int16 label\n"
    "property float z\nproperty double time\nproperty list uint8 float32 w\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
ROWS = [
    (0.5, 255, 1.25, -7, 2.0, 0.1, (1.5, 2.5)),
    (1.0, 0, 2.0, 300, 3.0, 1e300, (0.0, -1.0)),
    (4, 5, 6, 7, 8, 9, (8, 9)),
]


def full(encoding, cameras=((1.5, (1, 2, 3)), (2.5, (4,))), header=FULL):
    """A file with all that a PLY can have, its bytes put together one by one."""
    body = b""
    if encoding == "ascii":
        lines = [f"{focus} {len(pixels)} {' '.join(map(str, pixels))}" for focus, pixels in cameras]
        lines += [" ".join(map(str, (*row[:-1], len(row[-1]), *row[-1]))) for row in ROWS]
        body = ("\n".join([*lines, "3 0 1 2", "4 0 1 2 0"]) + "\n").encode()
    else:
        order = "<" if encoding == "binary_little_endian" else ">"

        def put(kind, *values):
            return np.array(values, order + kind).tobytes()

        for focus, pixels in cameras:
            body += put("f4", focus) + put("u1", len(pixels)) + put("i4", *pixels)
        for row in ROWS:
            for kind, value in zip(("f4", "u1", "f4", "i2", "f4", "f8"), row, strict=False):
                body += put(kind, value)
            body += put("u1", len(row[-1])) + put("f4", *row[-1])
        body += put("u1", 3) + put("i4", 0, 1, 2) + put("u1", 4) + put("i4", 0, 1, 2, 0)
    return header.format(encoding=encoding).encode() + body


def read(data):
    return read_cloud_bytes(data, ".ply")


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("cameras", [((1.5, (1, 2, 3)), (2.5, (4,))), ((1.5, (1, 2)), (2.5, (4, 5)))])
def test_every_property_is_read_and_other_elements_are_passed_over(encoding, cameras):
    cloud = read(full(encoding, cameras))
    assert cloud.points.tolist() == [[row[0], row[2], row[4]] for row in ROWS]
    assert {name: column.dtype.str[1:] for name, column in cloud.columns.items()} == {
        "red": "u1",
        "label": "i2",
        "time": "f8",
        "w": "f4",
    }
    assert all(column.dtype.isnative for column in cloud.columns.values())
    for name, at in {"red": 1, "label": 3, "time": 5, "w": 6}.items():
        assert cloud.columns[name].tolist() == [list(row[at]) if name == "w" else row[at] for row in ROWS]


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_the_same_kind_of_file_is_written_again(encoding):
    cloud = read(full(encoding))
    data = cloud_bytes(cloud, ".ply")
    header = data.partition(b"end_header")[0].decode().split("\n")
    assert header[:5] == ["ply", f"format {encoding} 1.0", "comment by hand: ä", "obj_info scan 7", "element vertex 3"]
    assert header[5:-1] == [
        *(f"property float {axis}" for axis in "xyz"),
        "property uchar red",
        "property short label",
        "property double time",
        "property list uchar float w",
    ]
    again = read(data)
    assert again.points.tobytes() == cloud.points.tobytes()
    assert {name: column.tolist() for name, column in again.columns.items()} == {
        name: column.tolist() for name, column in cloud.columns.items()
    }


def test_digits_in_text_are_not_cut_to_floats():
    text = FULL.format(encoding="ascii").split("element")[0]
    text += "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n4512345.678 0.1 1\n"
    assert read(text).points.tolist() == [[4512345.678, 0.1, 1]]


def test_line_ends_of_windows_and_comments_in_other_encodings_are_taken():
    cloud = read(full("ascii").replace(b"\n", b"\r\n").replace("ä".encode(), b"\xe4"))
    assert len(cloud) == 3
    assert b"comment by hand: \xe4\n" in cloud_bytes(cloud, ".ply")
    binary = full("binary_little_endian")
    head, _, body = binary.partition(b"end_header\n")
    assert read(head.replace(b"\n", b"\r\n") + b"end_header\r\n" + body).points.tolist() == cloud.points.tolist()


def test_a_name_in_another_encoding_is_one_that_every_format_takes():
    data = full("ascii").replace(b"time", b"\xb5s")
    for suffix in (".ply", ".npz", ".pcd", ".xyz", ".csv"):
        again = read_cloud_bytes(cloud_bytes(read(data), suffix), suffix)
        assert again.columns["_s" if suffix == ".pcd" else "\ufffds"].tolist() == [0.1, 1e300, 9]


def test_what_other_programs_write_is_read():
    mesh = trimesh.creation.box()
    mesh.visual.vertex_colors = np.arange(32).reshape(8, 4).astype("u1")
    for encoding in ("ascii", "binary_little_endian"):
        cloud = read(mesh.export(file_type="ply", encoding=encoding.partition("_")[0], vertex_normal=True))
        np.testing.assert_allclose(cloud.points, mesh.vertices)
        np.testing.assert_allclose(cloud.columns["nz"], mesh.vertex_normals[:, 2], rtol=1e-5)
        assert [cloud.columns[name][7] for name in ("red", "green", "blue", "alpha")] == [28, 29, 30, 31]
        assert list(cloud.columns) == ["nx", "ny", "nz", "red", "green", "blue", "alpha"]


def test_a_file_of_all_elements_that_is_cut_off_is_refused():
    for encoding in ("binary_little_endian", "binary_big_endian"):
        whole = full(encoding)
        faces = 1 + 12 + 1 + 16  # after the vertices nothing is missed
        for length in range(len(whole)):
            if length < len(whole) - faces:
                with pytest.raises(UserError):
                    read(whole[:length])
            else:
                assert len(read(whole[:length])) == 3


def header(*lines, count=1):
    axes = "property float x\nproperty float y\nproperty float z\n"
    return f"ply\nformat ascii 1.0\nelement vertex {count}\n{axes}" + "".join(f"{line}\n" for line in lines)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (header(), "its header has no end"),
        (header("property half w", "end_header", "1 2 3 4"), "the type 'half': char, uchar"),
        (header("rubbish here", "end_header", "1 2 3"), "its header has the line 'rubbish here'"),
        (header("property float x", "end_header", "1 2 3 4"), "are the coordinate x: x, y, z, x: rename one of them"),
        (header("end_header", "1 2"), "have 2 numbers each, at least 3 are needed"),
        (header("end_header", "1 2 3 4"), "have 4 numbers each, 3 are needed"),
        (header("end_header", "1 2 three"), "'z' of point 0 is 'three', which is no number"),
        (header("property uchar red", "end_header", "1 2 3 256"), "'red' holds 256.0 at point 0, which is no uint8"),
        (header("property int id", "end_header", "1 2 3 nan"), "'id' holds nan at point 0, which is no int32"),
        (header("end_header", "1 2 3", count=10**15), "cut off: 1 of its 1000000000000000 points"),
        (header("end_header", "1 2 3", count=-1), "the line 'element vertex -1'"),
        (
            header("property list uchar int w", "end_header", "1 2 3 1 9", "1 2 3 2 9 9 9", count=2),
            "has 7 numbers and the first has 5",
        ),
        (header("end_header", "1 2 3", "4 5 six", count=2), "'z' of point 1 is 'six', which is no number"),
        (header("property list float int w", "end_header", "1 2 3 1 9"), "length is a 'float': lengths are integers"),
        (header("end_header", "1 2 3").replace("float x", "list uchar float x"), "'x' is none of its vertices"),
        (header("property list uchar int w", "end_header", "1 2 3 1 9", "1 2 3 2 9", count=2), "different lengths on"),
        (header("property list uchar int w", "end_header", "1 2 3 9 9"), "have 5 numbers each, at least 13"),
        (header("end_header", "1 2 3").replace("ascii", "binary"), "its format is 'binary': ascii, "),
        (header("end_header", "1 2 3").replace("vertex", "point"), "it has no vertices, only point"),
        ("ply\nformat ascii 1.0\nend_header\n", "it has no vertices, only an empty header"),
        (
            header("end_header", "1 2 3").replace("element", "element a 9\nproperty int b\nelement"),
            "row 0 of its 'a' has other numbers than the header says",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said(data, reason):
    with pytest.raises(UserError, match=reason) as caught:
        read(data)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [2, 10**17])
def test_lists_that_cannot_be_are_refused(count):
    lines = header("property list int float w", "end_header", count=count).replace("ascii", "binary_little_endian")
    row = np.zeros(3, "f4").tobytes()
    for length, reason in ((2**30, "a list of 1073741824 numbers"), (-1, "a list of -1"), (1, "cut off")):
        with pytest.raises(UserError, match=reason):
            read(lines.encode() + row + np.array([length], "i4").tobytes() + np.zeros(1, "f4").tobytes())


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("before", [False, True])
def test_lists_of_different_lengths_are_left_out(encoding, before):
    """Against the file without the lists, with faces of three and four corners before the vertices or without."""
    order = {"binary_big_endian": ">"}.get(encoding, "<")
    rng = np.random.default_rng(0)
    points, labels = rng.random((40, 3)).astype("f4"), rng.integers(0, 99, 40).astype("u2")
    text, rows = [], []
    if before:
        text += ["3 0 1 2", "4 0 1 2 3"]
        rows += [np.array([n], "u1").tobytes() + np.arange(n).astype(f"{order}i4").tobytes() for n in (3, 4)]
    for number, (point, label) in enumerate(zip(points, labels, strict=True)):
        seen = np.arange(number % 4)
        text.append(" ".join(map(str, [*point, len(seen), *seen, label])))
        rows += [point.astype(f"{order}f4").tobytes(), np.array([len(seen)], f"{order}u2").tobytes()]
        rows += [seen.astype(f"{order}i4").tobytes(), np.array([label], f"{order}u2").tobytes()]
    head = "element face 2\nproperty list uchar int vertex_indices\n" if before else ""
    head = header("property list ushort int view", "property ushort label", "end_header", count=40).replace(
        "element", f"{head}element", 1
    )
    data = head.replace("ascii", encoding).encode()
    data += "\n".join(text).encode() if encoding == "ascii" else b"".join(rows)
    with pytest.warns(
        PcsrWarning, match="it: the lists 'view' of its 40 points have different lengths and were left out"
    ):
        cloud = read(data)
    np.testing.assert_array_equal(cloud.points.astype("f4"), points)
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {"label": labels.tolist()}
    assert cloud.columns["label"].dtype == np.uint16


@pytest.mark.parametrize(
    "body",
    [
        "1 2 3 4 5 6",
        "1\n2\n3\n4 5\n6\n",
        "\t1  2\t3 \r\n\r\n4 5 6",
        "1 2 3\r4 5 6\r",
        "1 2 3 4\n5 6",
        "+1 2. 3e0\n4 5 6\n\n",
    ],
)
@pytest.mark.parametrize("before", ["", "9 9\n9\n", "9 9 9\n"])
def test_numbers_in_text_have_any_spacing(body, before):
    head = header("end_header", count=2)
    if before:
        head = head.replace("element", "element view 1\nproperty int a\nproperty int b\nproperty int c\nelement", 1)
    assert read(head + before + body).points.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_headers_of_any_line_ends_and_names_in_capitals_are_read():
    text = header("property uchar my label", "end_header", "1 2 3 4").replace("float x", "FLOAT X")
    for end in ("\n", "\r\n", "\r"):
        cloud = read(text.replace("\n", end))
        assert cloud.points.tolist() == [[1, 2, 3]]
        assert {name: column.tolist() for name, column in cloud.columns.items()} == {"my_label": [4]}


def test_what_follows_the_points_is_counted():
    with pytest.warns(PcsrWarning, match="it goes on for 1 lines after its 1 points: these were left out"):
        assert len(read(header("end_header", "1 2 3", "4 5 6"))) == 1
    binary = header("end_header").replace("ascii", "binary_little_endian").encode() + np.zeros(7, "f4").tobytes()
    with pytest.warns(PcsrWarning, match="it goes on for 16 bytes after its 1 points"):
        assert len(read(binary)) == 1


def test_a_second_property_of_a_name_gets_another():
    with pytest.warns(PcsrWarning, match="two properties of its vertices are called 'w': the second is read as 'w_2'"):
        cloud = read(header("property int w", "property float w", "end_header", "1 2 3 4 5"))
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {"w": [4], "w_2": [5]}


def test_numbers_of_windows_that_are_not_finite_are_known():
    rows = ["1 2 3 -nan(ind)", "4 5 6 1.#QNAN", "7 8 9 -1.#INF", "7 8 9 1.#INF00"]
    column = read(header("property float w", "end_header", *rows, count=4)).columns["w"]
    np.testing.assert_array_equal(column, [np.nan, np.nan, -np.inf, np.inf])
