"""Decimal commas: 1,5 is read as 1.5, or refused; it never becomes two columns."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from tests.clouds.reading import read_cloud_bytes

POINTS = np.round(np.random.default_rng(0).normal(size=(40, 3)), 6)


def read(text, suffix=".xyz", **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_cloud_bytes(text, suffix, **options)


def german(rows, gap, form="{:.6f}", end="\n"):
    return "".join(gap.join(form.format(number).replace(".", ",") for number in row) + end for row in rows)


@pytest.mark.parametrize("suffix", [".xyz", ".txt", ".asc", ".csv", ".pts"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " \n"])
@pytest.mark.parametrize("gap", [" ", "  ", "\t", ";", "; ", "|"])
@pytest.mark.parametrize("form", ["{:.6f}", "{:+.6f}", "{:.8e}", "{:.8E}"])
def test_they_are_read_between_all_separators(suffix, end, gap, form):
    np.testing.assert_allclose(read(german(POINTS, gap, form, end), suffix).points, POINTS, atol=1e-7)


@pytest.mark.parametrize("gap", [" ", "\t", ";"])
@pytest.mark.parametrize("names", ["x y z label", "// X Y Z label", ""])
def test_integers_beside_them_stay_integers(gap, names):
    rows = german(POINTS, gap).splitlines()
    text = names.replace(" ", gap) + "\n" + "".join(f"{row}{gap}{i}\n" for i, row in enumerate(rows))
    cloud = read(text)
    np.testing.assert_array_equal(cloud.points, POINTS)
    (label,) = cloud.columns.values()
    assert label.dtype == np.int64
    assert label.tolist() == list(range(40))


def test_one_column_of_decimals_is_enough():
    assert read("1 2 0,5\n3 4 5\n").points.tolist() == [[1, 2, 0.5], [3, 4, 5]]
    assert read("x;y;z\n1;2;0,5\n3;4;5\n", ".csv").points.tolist() == [[1, 2, 0.5], [3, 4, 5]]
    assert read("1 2 3\n3 4 5\n" + "1,5 2 3\n" * 2).points[2].tolist() == [1.5, 2, 3]


@pytest.mark.parametrize("gap", [" ", "\t", ";"])
def test_words_of_windows_for_what_is_no_number_have_commas_too(gap):
    text = "1,5 2,5 3,25 1,#QNAN\n4 5,5 6,5 -1,#INF00e+000\n1,#IND 1 2,5 3\n".replace(" ", gap)
    cloud = read(text, bad="drop")
    assert cloud.points.tolist() == [[1.5, 2.5, 3.25], [4, 5.5, 6.5]]
    np.testing.assert_array_equal(cloud.columns["c3"], [np.nan, -np.inf])


def test_the_columns_of_a_pts_settle_what_could_be_either():
    cloud = read("2\n1,5 2,5 3 -8 9 8 7\n4,5 5,5 6 -9 3 2 1\n", ".pts")
    assert cloud.points.tolist() == [[1.5, 2.5, 3], [4.5, 5.5, 6]]
    assert cloud.columns["intensity"].tolist() == [-8, -9]


def test_quotes_say_which_commas_are_decimal():
    for gap in (",", ";", "\t"):
        text = f'"x"{gap}"y"{gap}"z"\n"0,5"{gap}"-1,25"{gap}"2"\n"0,75"{gap}3{gap}"4,125"\n'
        assert read(text, ".csv").points.tolist() == [[0.5, -1.25, 2], [0.75, 3, 4.125]]


def test_a_line_of_names_or_names_given_settle_what_could_be_either():
    for options, head in (({}, "x y z\n"), ({"columns": "x,y,z"}, "")):
        assert read(head + "1,2 3,4 5,6\n7,8 9,1 2,3\n", **options).points.tolist() == [
            [1.2, 3.4, 5.6],
            [7.8, 9.1, 2.3],
        ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1,2 3,4 5,6\n", "may have decimal commas .*, or commas and spaces between columns: write decimal points"),
        ("1,0 2,0 3,0\n4,0 5,0 6,0\n", "may have decimal commas"),
        ("12,345 67,891 23,456\n", "may be decimal commas or separate thousands"),
        ("12,345\t67,891\t23,456\n", "may be decimal commas or separate thousands"),
        ('"1,500","1,500","2,500"\n', "may be decimal commas or separate thousands"),
        ("0,273923,-0,460427,0,100373\n", "seems to have decimal commas and commas between columns"),
        ("0,27, -0,46, 0,10\n", "seems to have decimal commas and commas between columns"),
        ("1,5, 2,5, 3,5\n", "seems to have decimal commas and commas between columns"),
        ("x,y,z\n1,5,2,5,3,5\n", "seems to have decimal commas and commas between columns"),
        ("1.234,5 2.345,6 3.456,7\n", "separators of thousands, such as 1.234,5"),
        ("1.234,5\t2.345,6\t-12,5\n", "separators of thousands, such as 1.234,5: write them without"),
        ("1\u00a0234,5\t2\u00a0345,6\t-12,5\n", "separators of thousands, such as 1 234: write them without"),
        ("1\u202f234,5;2\u202f345,6;-12,5\n", "separators of thousands, such as 1 234: write them without"),
        ("1,234.5 2,345.6 3,456.7\n", "separators of thousands, such as 1,234.5"),
        ("1.234,5;2.345,6;3.456,7\n", "separators of thousands, such as 1.234,5"),
        ("0,5 1.5 2,5\n", "decimal commas .*, and has decimal points too"),
        ("0,5;1.5;2,5\n", "decimal points and commas, 1.5 and 0,5"),
        ("0,5;1,5;2,5\n" * 300 + "1.5;2.5;3.5\n", "decimal points and commas, 1.5 and 0,5"),
        ("1 2 3\n" * 300 + "0,5 1,5 2,5\n" * 2, r"line 301, column 1 \(x\): '0,5' is no number: write decimal points"),
        ("1,2,3\n" * 300 + "0,5 1,5 2,5\n" * 2, "line 301"),
        ("1.5,2.5 3\n" * 300 + "0,5 1,5 2,5\n" * 2, "line 301"),
    ],
)
def test_what_could_be_either_is_refused_with_a_remedy(text, reason):
    for suffix in (".xyz", ".csv"):
        with pytest.raises(UserError, match=reason):
            read(text, suffix)


@pytest.mark.parametrize(
    "text", ["1, 2, 3\n4, 5, 6\n", "1 ,2 ,3\n4 ,5 ,6\n", "1.0,2.0 3\n4.0,5.0 6\n", "1,2 3\n4,5 6\n"]
)
def test_commas_that_separate_columns_still_do(text):
    assert read(text).points.tolist() == [[1, 2, 3], [4, 5, 6]]


numbers = st.tuples(
    st.sampled_from(["", "-"]), st.integers(0, 9999), st.sampled_from([0, 1, 2, 3, 6]), st.integers(0, 999999)
)


@given(
    rows=st.lists(st.lists(numbers, min_size=3, max_size=3), min_size=1, max_size=4),
    gap=st.sampled_from([" ", "\t", ";", "; ", ",", ", ", " , "]),
    quoted=st.booleans(),
)
def test_no_decimal_comma_ever_becomes_two_columns(rows, gap, quoted):
    """Whatever stands around them, files with decimal commas give the points or a reason."""
    words = [
        [f"{sign}{whole}" + (f",{part:06d}"[: digits + 1] if digits else "") for sign, whole, digits, part in row]
        for row in rows
    ]
    text = "".join(gap.join(f'"{word}"' if quoted else word for word in row) + "\n" for row in words)
    plain_commas = not quoted and "," in gap and not any("," in word for row in words for word in row)
    try:
        points = read(text).points
    except UserError:
        assert not plain_commas
        return
    expected = [[float(word.replace(",", ".")) for word in row] for row in words]
    # Integers with a comma between each, such as 1,5,2,5,3,5, are what any such file is: columns.
    if quoted or "," not in gap or plain_commas:
        np.testing.assert_array_equal(points, expected)
