import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, table
from pcsr.clouds.formats.text import read_csv, read_xyz
from tests.clouds.reading import read_cloud_bytes, read_with_notes


def read(text, suffix=".xyz"):
    return read_cloud_bytes(text, suffix)


def found(cloud):
    return {name: (column.dtype.str[1:], column.tolist()) for name, column in cloud.columns.items()}


@pytest.mark.parametrize(
    ("suffix", "text", "columns"),
    [
        (".xyz", "1 2 3 7 0.5\n4 5 6 8 1\n", {"c3": ("i8", [7, 8]), "c4": ("f8", [0.5, 1])}),
        (".xyz", "1 2 3 1\n4 5 6 0.5\n", {"c3": ("f8", [1, 0.5])}),
        (".xyz", "1 2 3 1\n4 5 6 2.0\n", {"c3": ("f8", [1, 2])}),
        (".xyz", "1 2 3 0 9007199254740993\n4 5 6 1.5 1\n", {"c3": ("f8", [0, 1.5]), "c4": ("i8", [2**53 + 1, 1])}),
        (".xyz", "1 2 3 0\n4 5 6 -0.0\n", {"c3": ("f8", [0, -0.0])}),
        (".xyz", "1 2 3 9007199254740993\n4 5 6 -9223372036854775808\n", {"c3": ("i8", [2**53 + 1, -(2**63)])}),
        (".xyz", "1 2 3 9999999999999999999\n4 5 6 1\n", {"c3": ("f8", [1e19, 1])}),
        (
            ".xyz",
            "x y z a red green blue\n1 2 3 7 255 0 1\n4 5 6 7 0 0 1\n",
            {"a": ("i8", [7, 7]), "red": ("u1", [255, 0]), "green": ("u1", [0, 0]), "blue": ("u1", [1, 1])},
        ),
        (".xyz", "x y z red\n1 2 3 255\n4 5 6 0\n", {"red": ("i8", [255, 0])}),
        (
            ".xyz",
            "r x y z g b\n1 1 2 3 2 256\n1 4 5 6 2 3\n",
            {"red": ("u2", [1, 1]), "green": ("u2", [2, 2]), "blue": ("u2", [256, 3])},
        ),
        (".xyz", "//X Y Z Nx R\n1 2 3 1 9\n4 5 6 0 9\n", {"Nx": ("f8", [1, 0]), "R": ("i8", [9, 9])}),
        (".xyz", "x y z nx\n1 2 3 1\n4 5 6 0\n", {"nx": ("f8", [1, 0])}),
        (".xyz", "# a b c\n1 2 3 1\n// x y z\n4 5 6 0\n", {"c3": ("i8", [1, 0])}),
        (
            ".txt",
            "east north up a\r\n1 2 3 nan\r\n4 5 6 inf\r\n",
            {"a": ("f8", [pytest.approx(np.nan, nan_ok=True), np.inf])},
        ),
        (".txt", "1,2,3,4\n\n  \n4, 5 6\t5\n", {"c3": ("i8", [4, 5])}),
        (".csv", 'x,"my label",y,z\n1,7,2,3\n\n  \n4, 8,5,6\n', {"my label": ("i8", [7, 8])}),
        (
            ".csv",
            "b,z,y,x,R,g\n-1,3,2,1,1,2\n2,6,5,4,3,4\n",
            {"blue": ("i8", [-1, 2]), "red": ("i8", [1, 3]), "green": ("i8", [2, 4])},
        ),
        (
            ".csv",
            "b,z,y,x,R,g\n0.5,3,2,1,1,2\n2,6,5,4,3,4\n",
            {"blue": ("f8", [0.5, 2]), "red": ("i8", [1, 3]), "green": ("i8", [2, 4])},
        ),
        (
            ".csv",
            "b,z,y,x,R,g\n70000,3,2,1,1,2\n2,6,5,4,3,4\n",
            {"blue": ("i8", [70000, 2]), "red": ("i8", [1, 3]), "green": ("i8", [2, 4])},
        ),
        (".csv", ' "x", "y","z"\n "1", "2","3"\n4 ,5,6\n', {}),
        # Spaces ahead of quotes are read word by word.
        (
            ".csv",
            'x,y,z,a,b,c\n1,2,3, "9007199254740993",1,-9\n4,5,6,7,1.5,9999999999999999999\n',
            {"a": ("i8", [2**53 + 1, 7]), "b": ("f8", [1, 1.5]), "c": ("f8", [-9, 1e19])},
        ),
    ],
)
def test_columns_beside_the_coordinates_are_kept(suffix, text, columns):
    cloud = read(text, suffix)
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found(cloud) == columns


def test_names_that_are_missing_or_there_twice_are_made_up():
    cloud = read("a,X,Y,Z,a,,x\n0,1,2,3,4,5,6\n", ".csv")
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {
        "a": [0],
        "a_2": [4],
        "c5": [5],
        "x_2": [6],
    }


@pytest.mark.parametrize(
    ("suffix", "text", "reason"),
    [
        (".xyz", "1 2 3 4\n5 6 7\n", "line 2 has 3 columns, the first has 4"),
        (".xyz", "1 2 3\n\n5 6 7 8\n", "line 3 has 4 columns, the first has 3"),
        (".xyz", "1 2\n3 4\n", "line 1 has 2 columns, at least 3 are needed"),
        (".xyz", "1 2 3 4\n# it\n5 6 cat 7\n", r"line 3, column 3 \(z\): 'cat' is no number"),
        (".xyz", "C 1 2 3\nC 5 6 7\n", r"line 1, column 1 \(x\): 'C' is no number: say .* --columns -,x,y,z"),
        (".xyz", "y z label red\n1 2 3 4 5\n", "its line of names, y, z, label, red, does not name x, y and z of 5"),
        (".xyz", "lat lon h\n1 2 3\n", "degrees: project them to metres"),
        (".xyz", "x y z a\n1 2 3\n", "its line of names has 4 columns, the line after it has 3"),
        (
            ".csv",
            "u;v;w\n1;2;3\n",
            "its columns are u, v, w: name those of the coordinates x, y and z, or .* --columns",
        ),
        (".csv", "x,y,time\n1,2,3\n", "its columns are x, y, time: name those of the coordinates x, y and z"),
        (".csv", "x,y,z\n", "holds no points"),
        (".xyz", "\n \n", "holds no points"),
    ],
)
def test_a_line_at_fault_is_named(suffix, text, reason):
    with pytest.raises(UserError, match=reason):
        read(text, suffix)


def test_points_alone_may_have_anything_beside_them():
    for text in ("1 2 3 cat\n4 5 6\n", "x y z name\n1 2 3 cat dog\n4 5 6\n"):
        assert read_xyz(text.encode(), all_columns=False).points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert read_csv(b"name,z,y,x\ncat,3,2,1\n,6,5,4,9\n", all_columns=False).points.tolist() == [[1, 2, 3], [4, 5, 6]]


numbers = st.one_of(st.integers(-(2**60), 2**60).map(str), st.floats(allow_nan=False).map(repr))


@given(
    rows=st.lists(st.lists(numbers, min_size=5, max_size=5), min_size=1, max_size=5),
    gap=st.sampled_from([" ", ",", "\t", " , "]),
    end=st.sampled_from(["\n", "\r\n", "\n\n"]),
    named=st.booleans(),
)
def test_fast_reading_gives_what_reading_word_by_word_gives(rows, gap, end, named):
    head = gap.join(["x", "y", "z", "some", "more"]) + end if named else ""
    cloud = read_xyz((head + end.join(gap.join(row) for row in rows)).encode())
    expected = np.array([[float(word) for word in row] for row in rows])
    np.testing.assert_array_equal(cloud.points, expected[:, :3])
    assert list(cloud.columns) == (["some", "more"] if named else ["c3", "c4"])
    for at, column in enumerate(cloud.columns.values(), 3):
        written = [row[at] for row in rows]
        if all(word.lstrip("-").isdecimal() for word in written):
            assert column.dtype == np.int64
            assert column.tolist() == [int(word) for word in written]
        else:
            np.testing.assert_array_equal(column.astype(float), expected[:, at])


POINTS = np.array([[1.0, 2.0, 3.0]])


@pytest.mark.parametrize(
    ("suffix", "columns", "about", "text"),
    [
        (".xyz", {}, {}, "1.0 2.0 3.0\n"),
        (".xyz", {}, {"text": {"header": True}}, "x y z\n1.0 2.0 3.0\n"),
        (".xyz", {"c3": [7]}, {"text": {"header": False}}, "1.0 2.0 3.0 7\n"),
        (".xyz", {"c3": [7]}, {}, "1.0 2.0 3.0 7\n"),
        (".xyz", {"a b": [7]}, {"text": {"header": False}}, "x y z a_b\n1.0 2.0 3.0 7\n"),
        (".txt", {"w": [[7, 8]]}, {}, "x y z w_0 w_1\n1.0 2.0 3.0 7 8\n"),
        (".csv", {}, {}, "x,y,z\n1.0,2.0,3.0\n"),
        (".csv", {"c3": [7]}, {"text": {"header": False}}, "1.0,2.0,3.0,7\n"),
        (".csv", {"rgb": [[7, 8, 9]], "on": [True]}, {}, "x,y,z,red,green,blue,on\n1.0,2.0,3.0,7,8,9,1\n"),
    ],
)
def test_names_are_written_where_they_were_or_would_be_lost(suffix, columns, about, text):
    cloud = Cloud(POINTS, {name: np.array(column) for name, column in columns.items()}, about)
    data = cloud_bytes(cloud, suffix)
    assert data.decode() == text
    assert cloud_bytes(read(data, suffix), suffix) == data


@pytest.mark.parametrize("suffix", [".xyz", ".csv"])
def test_what_was_read_is_written_with_a_line_of_names_if_there_was_one(suffix):
    for head in ("x y z\n", ""):
        text = (head + "1.0 2.0 3.0\n").replace(" ", "," if suffix == ".csv" else " ")
        assert cloud_bytes(read(text, suffix), suffix).decode() == text


@pytest.mark.parametrize("text", ["1, 2, 3\n", "1,2,3\n", "1 2 3\n", "1.5, 2.5 3\n"])
def test_commas_between_columns_are_no_decimal_commas(text):
    assert read_xyz(text.encode()).points.shape == (1, 3)


LONG = 1 << 19


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 2 3\n" + ";" * LONG + "1\n", "line 2 has 1 columns, at least 3 are needed"),
        ("x y" + " " * LONG + "z i\n1 2 3 4\n", None),
        ("# x y z" + " as (" * (LONG // 5) + "\n1 2 3\n", None),
    ],
)
def test_long_runs_of_separators_are_no_burden(text, reason):
    """A pattern that looks at each of them from each of them would take hours."""
    if reason is None:
        assert read_with_notes(text, ".csv")[0].points.tolist() == [[1, 2, 3]]
    else:
        with pytest.raises(UserError, match=reason):
            read(text)


def test_many_columns_that_are_no_integers_further_down_take_few_attempts(monkeypatch):
    attempts, fast = [], table._read_fast
    monkeypatch.setattr(table, "_read_fast", lambda *arguments: attempts.append(1) or fast(*arguments))
    width = 40
    text = ("1 " * width + "\n") * 300 + "1 2 3 4 " + "0.5 " * (width - 5) + "NA\n"
    columns = found(read_with_notes(text, ".xyz")[0])
    assert len(attempts) <= table.ATTEMPTS < width - 4
    assert columns["c3"] == ("i8", [1] * 300 + [4])
    assert all(columns[f"c{i}"] == ("f8", [1.0] * 300 + [0.5]) for i in range(4, width - 1))
    assert np.isnan(columns[f"c{width - 1}"][1][-1])
