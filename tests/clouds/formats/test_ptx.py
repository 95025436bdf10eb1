"""PTX: scans with poses, in one frame."""

import numpy as np
import pytest

from pcsr import UserError
from tests.clouds.reading import read_with_notes

ROTATION = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
ROWS = np.array([[1, 2, 3, 0.5], [0, 0, 0, 0], [4, 5, 6, 0.25], [7, 8, 9, 1]])


def scan(rows, rotation=ROTATION, shift=(10, 20, 30), size=None, *, of_columns=False):
    """A scan as the programs of scanners write it; `of_columns` puts the shift into the last column."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = rotation.T, shift  # of row vectors
    lines = [*(size or (2, len(rows) // 2)), "0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    lines += [" ".join(map(str, row)) for row in (matrix.T if of_columns else matrix)]
    return "\n".join([*map(str, lines), *(" ".join(f"{word:.17g}" for word in row) for row in rows)]) + "\n"


def read(text):
    return read_with_notes(text, ".ptx")


MOVED = "its points are in the common frame, by the transformations in its headers"
EMPTY = "1 of 4 pixels have no point (0 0 0) and are left out"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " \n"])
@pytest.mark.parametrize("of_columns", [False, True])
def test_points_are_turned_and_shifted_by_the_header(end, of_columns):
    cloud, said = read(scan(ROWS, of_columns=of_columns).replace("\n", end))
    there = ROWS[[0, 2, 3]]
    np.testing.assert_allclose(cloud.points, there[:, :3] @ ROTATION.T + (10, 20, 30))
    assert cloud.columns["intensity"].tolist() == there[:, 3].tolist()
    assert said == [EMPTY, MOVED]


def test_each_scan_has_its_own_transformation():
    shifts = ((0, 0, 0), (10, 20, 30), (0, 0, 0))
    cloud, said = read("\n".join(scan(ROWS[2:], np.eye(3), shift) for shift in shifts))
    np.testing.assert_array_equal(cloud.points, np.concatenate([ROWS[2:, :3] + shift for shift in shifts]))
    assert said == [MOVED]


def test_a_scan_in_the_common_frame_keeps_every_digit():
    cloud, said = read(scan([[0.1, 1e-17, 500_000.123, 1]] * 2, np.eye(3), (0, 0, 0)))
    assert cloud.points.tolist() == [[0.1, 1e-17, 500_000.123]] * 2
    assert said == []


def test_colours_that_not_all_scans_have_are_left_out():
    coloured = [[1, 2, 3, 0.5, 9, 8, 7]] * 2
    assert read(scan(coloured))[0].columns["red"].tolist() == [9, 9]
    cloud, said = read(scan(coloured) + scan(ROWS))
    assert list(cloud.columns) == ["intensity"]
    assert said[0] == "not all of its scans have blue, green, red, which is left out"


def test_decimal_commas_are_read():
    cloud, said = read(scan(ROWS).replace(".", ","))
    np.testing.assert_array_equal(cloud.points, read(scan(ROWS))[0].points)
    assert said[0] == "its commas were read as decimal points"


WHOLE = scan(ROWS)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        ("1 2 3\n4 5 6\n", "line 1 of the file should be the number of columns, 1 numbers, and is '1 2 3'"),
        (WHOLE.rpartition("7 8 9")[0], "it is cut off: 3 of 4 points are there from line 11 on"),
        (WHOLE[:20], "line 5 of the file should be"),
        (WHOLE + WHOLE[:4], "line 17 of the file should be"),
        (scan(np.ones((2, 5000))), "it has 5000 columns, and 4096 are the most: remove some"),
        (scan(ROWS, size=(2.5, 2)), "lines 1 and 2 hold 2.5 and 2, no numbers of columns and rows"),
        (scan(ROWS, size=(-2, -2)), "lines 1 and 2 hold -2 and -2, no numbers of columns and rows"),
        (scan(ROWS, size=(10**9, 10**9)), "it is cut off: 4 of 10*0 points are there"),
        (scan(ROWS, np.zeros((3, 3))), "the transformation in lines 7 to 10 is not invertible"),
        (scan(ROWS * 0), "it holds no points"),
        (WHOLE.replace("4 5 6", "4 five 6"), r"line 13, column 2 \(y\): 'five' is no number"),
    ],
)
def test_damage_is_said_with_its_line(text, reason):
    with pytest.raises(UserError, match=reason):
        read(text)
