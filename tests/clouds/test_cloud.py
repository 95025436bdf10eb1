import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import colour_names, native, normal_groups, one_word_names, spread, unused

POINTS = np.arange(12.0).reshape(4, 3)


def row(kind="f8"):
    return np.arange(4).astype(kind)


def test_chosen_rows_take_their_columns_along():
    cloud = Cloud(POINTS, {"label": row("i4"), "colors": np.arange(12).reshape(4, 3)}, {"ply": {}})
    for rows in (np.array([3, 1]), np.array([False, True, False, True])):
        some = cloud.chosen(rows)
        np.testing.assert_array_equal(some.points, POINTS[rows])
        np.testing.assert_array_equal(some.columns["label"], row("i4")[rows])
        assert some.columns["colors"].shape == (2, 3)
        assert some.about is cloud.about
    assert (len(cloud), len(some)) == (4, 2)


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        ({"x": row()}, "a column of a cloud is called 'x', the name of a coordinate"),
        ({"label": row()[:3]}, r"'label' holds float64 \(3,\): it needs 4 rows of numbers"),
        ({"label": np.array(list("abcd"))}, "'label' holds <U1"),
        ({"label": np.zeros((4, 2, 2))}, r"\(4, 2, 2\)"),
    ],
)
def test_what_is_no_cloud_is_refused(columns, reason):
    with pytest.raises(UserError, match=reason):
        Cloud(POINTS, columns)


@pytest.mark.parametrize("points", [POINTS.astype("i4"), POINTS.astype("f4"), POINTS[:, :2], POINTS[0]])
def test_points_are_doubles_even_where_nobody_checks_the_types(points):
    cloud = Cloud(POINTS)
    object.__setattr__(cloud, "points", points)
    with pytest.raises(UserError, match=r"points must be doubles of shape \(n, 3\), got "):
        cloud.__post_init__()


def test_new_points_follow_the_old_with_their_columns():
    cloud = Cloud(POINTS, {"label": row("i4")}, {"ply": {}})
    new = POINTS[[2, 0]] + 0.1
    dense = cloud.with_new(new)
    np.testing.assert_array_equal(dense.points, np.concatenate([POINTS, new]))
    assert dense.columns["label"].tolist() == [0, 1, 2, 3, 2, 0]
    assert dense.columns["label"].dtype == np.int32
    alone = cloud.with_new(new, keep=False)
    np.testing.assert_array_equal(alone.points, new)
    assert alone.columns["label"].tolist() == [2, 0]
    assert dense.about is alone.about is cloud.about


def test_colours_and_normals_are_known_by_name_and_width():
    columns = dict.fromkeys(("Red", "r", "label", "blue", "rgb", "alpha"), row()) | {"colors": np.zeros((4, 4))}
    assert colour_names(columns) == ["colors"]
    assert colour_names({**columns, "green": row()}) == ["Red", "blue", "alpha", "colors", "green"]
    assert colour_names({"r": row(), "g": row(), "b": row()}) == ["r", "g", "b"]
    assert colour_names({"r": row(), "g": row()}) == []
    assert colour_names({"colors": np.zeros((4, 2))}) == []
    assert normal_groups({"NZ": row(), "nx": row(), "ny": row(), "normals": POINTS}) == [
        ["nx", "ny", "NZ"],
        ["normals"],
    ]
    assert normal_groups({"nx": row(), "ny": row(), "normals": np.zeros((4, 4))}) == []


def test_blocks_become_the_columns_that_most_formats_have():
    block = np.arange(12).reshape(4, 3).astype("u1")
    columns = {"colors": block, "normals": POINTS, "weights": POINTS[:, :2]}
    flat = spread(columns, rest=False)
    assert list(flat) == ["red", "green", "blue", "nx", "ny", "nz", "weights"]
    np.testing.assert_array_equal(flat["blue"], block[:, 2])
    assert list(spread(columns, rest=True))[-2:] == ["weights_0", "weights_1"]
    assert list(spread({"colors": block, "red": row()}, rest=True)) == ["colors_0", "colors_1", "colors_2", "red"]
    assert list(spread({"colors": block, "red": row()}, rest=False)) == ["colors", "red"]


def test_names_are_made_one_word_and_stay_apart():
    assert list(one_word_names({"a b": row(), "a,b": row(), "": row(), "x ": row()})) == ["a_b", "a_b_2", "_", "x_"]
    assert unused("a", ["a", "a_2"]) == "a_3"
    assert unused("b", ["a"]) == "b"


def test_foreign_byte_order_is_turned():
    column = native(np.arange(3, dtype=">i4")[::-1])
    assert column.dtype == np.int32
    assert column.dtype.isnative
    assert column.tolist() == [2, 1, 0]


def test_doubles_that_a_file_calls_floats_stay_what_they_are():
    cloud = Cloud(np.array([[1e300, 2, 3]]), {}, {"ply": {"coordinates": "float"}})
    new = np.array([[1e300, 0.1, 0.1]])
    assert cloud.with_new(new, keep=False).points.tolist() == new.tolist()
    single = cloud.with_new(new * [0, 1, 1], keep=False).points
    assert single.tolist() == [[0, np.float32(0.1), np.float32(0.1)]]
