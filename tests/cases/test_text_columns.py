"""Text whose columns are named, guessed, given or damaged: each is what its name says, or the file is refused."""

import re

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.formats import cloud_bytes, read_cloud, read_points
from tests.clouds.reading import read_with_notes


def read(text, suffix=".xyz", **options):
    return read_with_notes(text, suffix, **options)


def found(cloud):
    return {name: column.tolist() for name, column in cloud.columns.items()}


def read_points_of(folder, text, suffix):
    path = folder / f"it{suffix}"
    path.write_text(text, encoding="utf-8")
    return read_points(path)


@pytest.mark.parametrize(
    ("suffix", "text", "columns"),
    [
        # COLMAP, with lists of varying length, and without any.
        (
            ".txt",
            "# 3D point list with one line of data per point:\n"
            "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
            "# Number of points: 2, mean track length: 1\n"
            "7 1 2 3 159 71 60 0.5 1 2 3 4\n8 4 5 6 16 10 60 0.25 1 2\n",
            {"POINT3D_ID": [7, 8], "red": [159, 16], "green": [71, 10], "blue": [60, 60], "ERROR": [0.5, 0.25]},
        ),
        (
            ".txt",
            "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
            "7 1 2 3 159 71 60 0\n8 4 5 6 16 10 60 0 \n",
            {"POINT3D_ID": [7, 8], "red": [159, 16], "green": [71, 10], "blue": [60, 60], "ERROR": [0, 0]},
        ),
        # CloudCompare, with the number of points on a line of its own.
        (
            ".txt",
            "//X;Y;Z;Rf;Gf;Bf;Nx;Ny;Nz\n2\n1;2;3;0.5;0.25;1;0;0;1\n4;5;6;0.5;0.25;1;0;1;0\n",
            {
                "red": [0.5, 0.5],
                "green": [0.25, 0.25],
                "blue": [1, 1],
                "nx": [0, 0],
                "ny": [0, 1],
                "nz": [1, 0],
            },
        ),
        (".asc", "//X Y Z R G B\n1 2 3 9 8 7\n4 5 6 3 2 1\n", {"red": [9, 3], "green": [8, 2], "blue": [7, 1]}),
        (".txt", "# Columns: id x y z\n7 1 2 3\n8 4 5 6\n", {"id": [7, 8]}),
        (".txt", "# id x y z\n# x y z are metres\n7 1 2 3\n8 4 5 6\n", {"id": [7, 8]}),
        # A mark that is a column, and one that is none.
        (".txt", "#\tx\ty\tz\n1\t2\t3\n4\t5\t6\n", {}),
        (".csv", "#;x;y;z\n7;1;2;3\n8;4;5;6\n", {"c0": [7, 8]}),
        # Units, other names, other separators.
        (".csv", "id,X [m],Y [m],Z [m]\n7,1,2,3\n8,4,5,6\n", {"id": [7, 8]}),
        (".txt", "id\tX(m)\tY(m)\tZ(m)\n7\t1\t2\t3\n8\t4\t5\t6\n", {"id": [7, 8]}),
        (".xyz", "id X_mm Y_mm Z_mm\n7 1 2 3\n8 4 5 6\n", {"id": [7, 8]}),
        (".xyz", "ID Coord. X Coord. Y Coord. Z\n7 1 2 3\n8 4 5 6\n", {"ID": [7, 8]}),
        (".csv", "id,Easting,Northing,Height\n7,1,2,3\n8,4,5,6\n", {"id": [7, 8]}),
        (".csv", "id;Rechtswert;Hochwert;Höhe\n7;1;2;3\n8;4;5;6\n", {"id": [7, 8]}),
        (".csv", "POINT_Z,POINT_Y,POINT_X\n3,2,1\n6,5,4\n", {}),
        (".csv", '"Normals:0","Points:0","Points:1","Points:2"\n7,1,2,3\n8,4,5,6\n', {"Normals:0": [7, 8]}),
        (".xyz", "x|y|z|t\n1|2|3|7\n4|5|6|8\n", {"t": [7, 8]}),
        (".dat.xyz", 'VARIABLES = "X", "Y", "Z", "T"\n1 2 3 7\n4 5 6 8\n', {"T": [7, 8]}),
    ],
)
def test_names_are_obeyed_wherever_they_stand(tmp_path, suffix, text, columns):
    cloud, said = read(text, suffix[suffix.rfind(".") :])
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found(cloud) == columns
    points = read_points_of(tmp_path, text, suffix[suffix.rfind(".") :])
    assert points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert said == (["the lists 'TRACK[]' at the end of its lines are left out"] if "1 2 3 4" in text else [])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("# z y x\n1 2 3 4\n", "its comment names 3 columns, its lines have 4"),
        ('"x" "y" "z"\n"1" 1 2 3\n', "its line of names has 3 columns, the line after it has 4"),
        ("X [ft];X [m];Y;Z\n1;2;3;4\n", r"'X \[ft\]' and 'X \[m\]' may both be x"),
        ("lon lat height\n1 2 3\n", "degrees"),
        ("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n1 1 0 0 0 1 2 3 1 a.jpg\n", "name points3D.txt"),
        ("1 2 3\n4 5 6\nx y z\n7 8 9\n", r"line 3, column 1 \(x\): 'x' is no number: correct or remove the line"),
        (
            "1.234.567 1.234.567 12\n",
            "no line has numbers for x, y and z, .* its last line is '1.234.567 1.234.567 12'",
        ),
        ("OFF\n2 0 0\n1 2 3\n4 5 6\n", "it is an OFF mesh: name it .off"),
        ("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n", "ESRI grid"),
        (
            "3\nwater\nO 0 0 0\nH 1 0 0\nH 0 1 0\n",
            r"line 3, column 1 \(x\): 'O' is no number: say .* --columns -,x,y,z",
        ),
    ],
)
def test_names_that_do_not_say_which_column_is_which_are_refused(text, reason):
    with pytest.raises(UserError, match=reason):
        read(text)


def test_names_are_given_where_the_file_has_none(tmp_path):
    text = "a1 1 2 3 255 0 9 wall\na2 4 5 6 0 7 9 wall\n"
    cloud, said = read(text, columns="-,x,y,z,red,green,_")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found(cloud) == {"red": [255, 0], "green": [0, 7]}
    assert said == []
    assert read("x y z\n1 2 3\n", columns=["z", "Y", "x"])[0].points.tolist() == [[3, 2, 1]]  # they win
    assert found(read("1 2 3 9 8 7\n", columns="x y z R G B")[0]) == {"red": [9], "green": [8], "blue": [7]}
    path = tmp_path / "a.txt"
    path.write_text(text)
    assert read_cloud(path, columns="-,x,y,z").points.tolist() == read_points(path, columns="-,x,y,z").tolist()
    for columns, reason in {
        "x,y": "--columns x,y must name x, y and z",
        "x,y,z,x": "has 'x' twice",
        "-,x,y,z,a,b,c,d,e": "--columns names 9 columns, line 1 has 8",
    }.items():
        with pytest.raises(UserError, match=reason):
            read(text, columns=columns)
    with pytest.raises(UserError, match=r"it is a \.npy file, whose format .*: --columns is for \.asc, \.csv, \.pts"):
        read(cloud_bytes(cloud, ".npy"), ".npy", columns="x,y,z")


@pytest.mark.parametrize(
    ("text", "columns", "said"),
    [
        ("1 2 3 159 71 60\n4 5 6 16 10 60\n", "red green blue", "columns 4 to 6 were taken for colours"),
        ("1 2 3 0 0.6 0.8\n4 5 6 -1.0 0 0\n", "nx ny nz", "columns 4 to 6 were taken for normals"),
        ("1 2 3 -8 159 71 60\n4 5 6 -7 16 10 60\n", "c3 red green blue", "columns 5 to 7 were taken for colours"),
        ("1 2 3 9 8 7 255\n4 5 6 5 4 3 255\n", "red green blue alpha", "columns 4 to 7 were taken for colours"),
        (
            "1 2 3 9 8 7 0 .6 .8\n4 5 6 5 4 3 0 1. 0\n",
            "red green blue nx ny nz",
            "columns 7 to 9 were taken for normals",
        ),
        # Four small integers: an intensity or a class may be first or last.
        ("1 2 3 9 8 7 2\n4 5 6 5 4 3 6\n", "c3 c4 c5 c6", "which are colours or normals is not clear"),
        ("1 2 3 .1 .2 .3\n4 5 6 .3 .2 .1\n", "c3 c4 c5", "which are colours or normals is not clear"),
        ("1 2 3 0 1 1\n4 5 6 1 0 1\n", "c3 c4 c5", "which are colours or normals is not clear"),
        ("1 2 3 0 1\n4 5 6 1 0\n", "c3 c4", None),
        # A number of the point, a row and a column of the scan.
        ("1 2.0 3.0 4.5\n2 5.0 6.0 4.5\n", "c3", "first column holds integers and was taken for x: .* -,x,y,z,…"),
        ("1 2 3.0 4.5 0.5\n2 5 6.0 4.5 0.5\n", "c3 c4", "first two columns hold .* x and y: .* -,-,x,y,z,…"),
        ("1 2.0 3.0\n2 5.0 6.0\n", "", None),
    ],
)
def test_a_guess_at_columns_without_names_is_reported(text, columns, said):
    cloud, notes = read(text)
    assert list(cloud.columns) == columns.split()
    assert len(notes) == (said is not None)
    assert all(re.search(said, each) and "--columns" in each for each in notes)
    assert all(column.dtype == np.uint8 for name, column in cloud.columns.items() if name in ("red", "alpha"))
    # The file had no line of names, and other programs would not expect one.
    assert cloud_bytes(cloud, ".xyz").decode().split()[:3] == ["1.0", "2.0", "3.0"]
    assert "red" not in columns or b"property uchar red" in cloud_bytes(cloud, ".ply")


def test_text_is_written_with_the_names_that_it_had():
    text = "x y z R G B Normal_X Normal_Y Normal_Z\n1.0 2.0 3.0 9 8 7 0.0 0.0 1.0\n"
    cloud, _ = read(text)
    assert list(cloud.columns) == ["red", "green", "blue", "nx", "ny", "nz"]
    assert cloud_bytes(cloud, ".xyz").decode() == text


@pytest.mark.parametrize(
    ("text", "columns", "said"),
    [
        ("name,x,y,z\nP0,1,2,3\nP1,4,5,6\n", {}, ["column 'name' is not numbers, such as 'P0', and left out"]),
        ('x,y,z,"what, where"\n1,2,3,"a, b"\n4,5,6,c\n', {}, ["'what, where' is not numbers, such as 'a, b'"]),
        ("x,y,z,t\n1,2,3,2020-01-01 12:00:00\n4,5,6,2020-01-01 12:00:01\n", {}, ["column 't' is not numbers"]),
        ("1,2,3,\n4,5,6,\n", {}, ["column 4 is without any value and left out"]),
        ("x,y,z,\n1,2,3,\n4,5,6,\n", {}, ["column 4 is without any value and left out"]),
        ("x,y,z\n1,2,3,\n4,5,6,\n", {}, ["column 4 is without any value and left out"]),
        ("x,y,z,a\n1,2,3,\n4,5,6,\n", {}, ["column 'a' is without any value and left out"]),
        ("x,y,z,a\n1,2,3,\n4,5,6,7\n", {"a": [None, 7]}, ["column 'a' is without a value at 1 of 2 points: NaN"]),
        (
            "x,y,z,a\n1,2,3,NA\n4,5,6,7\n",
            {"a": [None, 7]},
            ["column 'a' is without a value at 1 of 2 points: NaN"],
        ),
        ("x,y,z,a\n1,2,3,-nan(ind)\n4,5,6,-1.#INF\n", {"a": [None, -np.inf]}, []),
        ("x,y,z,a\n1,2,3,8\n4,5,6,seven\n", {}, ["column 'a' is not numbers, such as 'seven', and left out"]),
        (
            "x,y,z,red,green,blue\n1,2,3,255,0,0\n4,5,6,,,\n",
            {"red": [255, 0], "green": [0, 0], "blue": [0, 0]},
            ["columns 'red', 'green', 'blue' are without a value at up to 1 of 2", "missing colours became black"],
        ),
    ],
)
def test_columns_of_words_and_gaps_are_read_and_told(text, columns, said):
    for suffix in (".csv", ".txt"):
        cloud, notes = read(text, suffix)
        assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
        values = {name: [None if np.isnan(x) else x for x in column] for name, column in cloud.columns.items()}
        assert values == columns
        assert len(notes) == len(said)
        assert all(part in each for part, each in zip(said, notes, strict=True))


@pytest.mark.parametrize(("gap", "suffix"), [(";", ".csv"), (",", ".csv"), ("|", ".txt")])
def test_empty_rows_of_spreadsheets_are_left_out(gap, suffix):
    text = "sep=;\r\n\r\n;;\r\nx;y;z\r\n1;2;3\r\n;;\r\n4;5;6\r\n ; ;\r\n;;\r\n".replace(";", gap)
    cloud, notes = read(text, suffix)
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert notes == ["3 lines of separators alone are left out"]


def test_fractions_of_colours_are_black_where_they_are_missing():
    cloud, notes = read("x,y,z,r,g,b\n1,2,3,0.5,0.25,1\n1,2,4,,,\n", ".csv")
    assert found(cloud) == {"red": [0.5, 0], "green": [0.25, 0], "blue": [1, 0]}
    assert notes[1] == "missing colours became black"


def test_colours_on_some_vertices_of_an_obj_are_black_on_the_others():
    cloud, notes = read("v 1 2 3\nv 4 5 6 0.5 0.25 1\nv 7 8 9 1.0\nv 1 1 1 1 1 1 0.5\n", ".obj")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9], [1, 1, 1]]
    assert found(cloud) == {"red": [0, 0.5, 0, 1], "green": [0, 0.25, 0, 1], "blue": [0, 1, 0, 1]}
    assert notes == ["2 of 4 vertices have no colour and became black"]
    assert found(read("v 1 2 3 0 0 0 0.5\nv 1 2 3\n", ".obj")[0])["alpha"] == [0.5, 0]


def test_colours_on_some_lines_only_are_black_on_the_others():
    cloud, notes = read("1 2 3 255 0 0\n4 5 6\n7 8 9 0 9 0\n4 5 7\n")
    assert found(cloud) == {"red": [255, 0, 0, 0], "green": [0, 0, 9, 0], "blue": [0, 0, 0, 0]}
    assert notes[0] == "2 of 4 lines have 3 columns instead of 6: what they lack is NaN"
    assert notes[2] == "missing colours became black"
    with pytest.raises(UserError, match="line 3 has 5 columns, the first has 3"):  # two lines in one
        read("1 2 3\n4 5 6\n7 8 94 5 7\n")


@pytest.mark.parametrize(
    "word", ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "1.#SNAN00", "-1.#IND00e+000", "NaN", "inf", "NULL"]
)
def test_points_that_are_not_finite_are_counted_and_dropped(word):
    text = f"{word} 1 2\n1 2 3\n4 5 {word}\n"
    with pytest.raises(UserError, match=r"2 of 3 points have a coordinate that is not finite: .* --bad drop"):
        read(text)
    cloud, _ = read(text, bad="drop")
    assert cloud.points.tolist() == [[1, 2, 3]]
    assert cloud.about["dropped"] == 2
    header = "1\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    for text, suffix in (
        (f"v {word} 1 2\nv 1 2 3\n", ".obj"),
        (f"OFF\n2 0 0\n{word} 1 2\n1 2 3\n", ".off"),
        (f"{header}{word} 1 2 0\n1 2 3 0\n", ".ptx"),
    ):
        assert read(text, suffix, bad="drop")[0].points.tolist() == [[1, 2, 3]]
    assert read("x,y,z\n1,,3\n1,2,3\n", ".csv", bad="drop")[0].points.tolist() == [[1, 2, 3]]
