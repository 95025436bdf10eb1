"""Colours of clouds by a column: their own, a scale, or classes."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds.colouring import MOST_CLASSES, Classes, Scale, colours_of
from pcsr.report.colours import CLASSES, INPUT, TOUCH, TRUTH

POINTS = np.arange(12.0).reshape(4, 3)


def cloud(**columns):
    return Cloud(POINTS, {name: np.asarray(column) for name, column in columns.items()})


def rgb(*, kind, rows, names=("red", "green", "blue")):
    return cloud(**dict(zip(names, np.array(rows, kind).T, strict=True)))


@pytest.mark.parametrize(
    ("kind", "rows", "expected"),
    [
        (np.uint8, [[0, 1, 255]] * 4, [0, 1, 255]),
        (np.uint16, [[0, 1, 255]] * 4, [0, 1, 255]),
        (np.uint16, [[0, 32896, 65535]] * 4, [0, 128, 255]),
        (np.float32, [[0, 0.5, 1]] * 4, [0, 128, 255]),
        (np.float64, [[0, 127.6, 255]] * 4, [0, 128, 255]),
        (np.float64, [[np.nan, 0.5, -3]] * 4, [0, 128, 0]),
        (np.int64, [[1, 0, 1]] * 4, [1, 0, 1]),
    ],
)
@pytest.mark.parametrize("names", [("red", "green", "blue"), ("Red", "GREEN", "Blue"), ("r", "g", "b")])
def test_colours_of_all_types_are_0_to_255(kind, rows, expected, names):
    colours = colours_of([rgb(kind=kind, rows=rows, names=names)])
    assert colours.key is None
    assert colours.clouds[0].tolist() == [expected] * 4


def test_a_block_of_colours_is_colours_too():
    assert colours_of([cloud(colors=np.tile([1.0, 0, 0], (4, 1)))], "rgb").clouds[0].tolist() == [[255, 0, 0]] * 4


def test_a_cloud_without_colours_stands_beside_one_with_them():
    colours = colours_of([cloud(), rgb(kind=np.uint8, rows=[[9, 9, 9]] * 4)])
    assert colours.clouds[0] is None
    assert colours.clouds[1].tolist() == [[9, 9, 9]] * 4


def test_colours_that_are_all_black_are_none_unless_they_are_asked_for():
    black = rgb(kind=np.uint16, rows=[[0, 0, 0]] * 4)
    assert colours_of([black]).key == Scale("z", 2.0, 11.0)
    assert colours_of([black], "rgb").clouds[0].tolist() == [[0, 0, 0]] * 4


@pytest.mark.parametrize(("by", "low", "high"), [("x", 0.0, 9.0), ("y", 1.0, 10.0), ("Z", 2.0, 11.0)])
def test_coordinates_are_on_a_scale(by, low, high):
    colours = colours_of([cloud()], by)
    assert colours.key == Scale(by, low, high)
    assert colours.clouds[0].tolist() == POINTS[:, "xyz".index(by.lower())].tolist()


def test_one_scale_holds_the_values_of_all_clouds():
    clouds = [cloud(heat=[0.5, 1, 2, np.nan]), cloud(), cloud(heat=[-1.5, np.inf, 7, 0])]
    colours = colours_of(clouds, "heat")
    assert colours.key == Scale("heat", -1.5, 7.0)
    assert colours.clouds[1] is None
    np.testing.assert_array_equal(colours.clouds[0], [0.5, 1, 2, np.nan])
    np.testing.assert_array_equal(colours.clouds[2], [-1.5, np.nan, 7, 0])


@pytest.mark.parametrize("kind", [np.int8, np.uint64, np.float32, bool])
def test_few_whole_numbers_are_classes_whatever_their_type(kind):
    values = np.array([1, 0, 1, 1] if kind is bool else [6, 2, 6, 6]).astype(kind)
    colours = colours_of([cloud(label=values), cloud(), cloud(label=values[::-1])], "LABEL")
    assert isinstance(colours.key, Classes)
    assert colours.key.labels == (["0", "1"] if kind is bool else ["2", "6"])
    assert colours.key.colours == CLASSES[:2]
    assert colours.clouds[0].tolist() == [1, 0, 1, 1]
    assert colours.clouds[1] is None
    assert colours.clouds[2].tolist() == [1, 1, 0, 1]


def test_a_point_without_a_label_has_no_class():
    assert colours_of([cloud(label=[6, np.nan, 2, 6])], "label").clouds[0].tolist() == [1, -1, 0, 1]


@given(st.lists(st.integers(-50, 50), min_size=1, max_size=60))
def test_each_label_is_that_of_its_point(values):
    made = Cloud(np.zeros((len(values), 3)), {"label": np.array(values, np.float64)})
    colours = colours_of([made], "label")
    if len(set(values)) <= MOST_CLASSES:
        assert [int(colours.key.labels[code]) for code in colours.clouds[0]] == values
    else:
        assert isinstance(colours.key, Scale)
        assert colours.clouds[0].tolist() == values


@pytest.mark.parametrize("values", [[0, 1, 1, 2], [0, 0, 0, 0], [1.0, 1, 1, 2]])
def test_the_column_source_marks_old_new_and_touched_points_by_default(values):
    coloured = {name: np.full(4, 9, np.uint8) for name in ("red", "green", "blue")}
    colours = colours_of([cloud(source=values, **coloured), cloud(**coloured)])
    assert colours.key == Classes("source", ("old", "new", "touched"), (TRUTH, INPUT, TOUCH))
    assert colours.clouds[0].tolist() == values
    assert colours.clouds[1] is None
    assert colours_of([cloud(source=values, **coloured)], "rgb").key is None


def test_of_several_columns_source_the_last_is_shown():
    made = cloud(source_2=[0, 0, 1, 1], source_10=[0, 1, 2, 2], source=[2, 2, 2, 2], source_11=[0, 1, 2, 3])
    colours = colours_of([made, cloud(Source=[1, 1, 1, 0])])
    assert colours.key == Classes("source", ("old", "new", "touched"), (TRUTH, INPUT, TOUCH))
    assert [codes.tolist() for codes in colours.clouds] == [[0, 1, 2, 2], [1, 1, 1, 0]]
    assert colours_of([made], "source_2").key == colours.key
    assert colours_of([made], "source_2").clouds[0].tolist() == [0, 0, 1, 1]


def test_a_source_of_other_numbers_is_a_label():
    made = cloud(source=[0, 1, 2, 3])
    assert colours_of([made]).key == Scale("z", 2.0, 11.0)
    assert colours_of([made], "source").key.labels == ["0", "1", "2", "3"]


def test_none_is_one_colour():
    colours = colours_of([rgb(kind=np.uint8, rows=[[9, 9, 9]] * 4)], "none")
    assert (colours.key, colours.clouds) == (None, [None])


def test_a_part_of_a_wide_column_has_its_number():
    wide = cloud(feature=np.arange(8.0).reshape(4, 2) / 10)
    assert colours_of([wide], "feature_1").clouds[0].tolist() == [0.1, 0.3, 0.5, 0.7]


@pytest.mark.parametrize(
    ("by", "said"),
    [
        ("intens", "did you mean 'intensity'?"),
        ("rgb", "known: intensity, none, x, y, z"),
        ("", "known: intensity, none, x, y, z"),
    ],
)
def test_a_column_that_is_not_there_is_named(by, said):
    with pytest.raises(UserError, match=re.escape(f"--color {by}: no cloud has such a column: {said}")):
        colours_of([cloud(), cloud(intensity=[0.5, 1, 2, 3])], by)


def test_a_column_without_any_number_colours_nothing():
    colours = colours_of([cloud(empty=np.full(4, np.nan))], "empty")
    assert colours.clouds[0] is None or not (np.nan_to_num(colours.clouds[0], nan=-1) >= 0).any()


def test_signalling_nan_is_no_value():
    heat = np.array([0, 1, 2, 3], np.float32)
    heat.view(np.uint32)[1] = 0x7FA00000
    assert colours_of([cloud(heat=heat)], "heat").clouds[0].tolist() == [0, -1, 1, 2]  # a warning would be an error
