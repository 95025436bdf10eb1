"""Line charts: what is drawn where, read off the figure."""

import math

import numpy as np
import pytest
from PIL import Image

from pcsr.errors import UserError
from pcsr.report.colours import SERIES
from pcsr.report.figures.canvas import DPI, encoded
from pcsr.report.figures.line_chart import BAND, HEIGHT, WIDTH, draw_lines, line_chart

X = [0, 1, 2, 3]
LINES = {"ours": ([2.0, 1.5, 1.2, 1.1], [0.4, 0.3, 0.2, 0.1]), "other": ([3.0, 2.8, 2.9, 2.7], None)}


def plot(*arguments):
    (axes,) = draw_lines(*arguments).axes
    return axes


def test_each_line_is_there_in_its_colour_with_its_numbers():
    figure = draw_lines("title", "x", "y", X, LINES)
    assert tuple(figure.get_size_inches()) == (WIDTH, HEIGHT)
    (axes,) = figure.axes
    assert (axes.get_title(loc="left"), axes.get_xlabel(), axes.get_ylabel()) == ("title", "x", "y")
    for line, colour, (mean, _) in zip(axes.lines, SERIES, LINES.values(), strict=False):
        assert line.get_color() == colour
        np.testing.assert_array_equal(line.get_xydata(), np.stack([X, mean], 1))
    assert len(axes.lines) == 2
    assert axes.get_ylim()[0] == 0
    assert axes.get_ylim()[1] > 3
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0", "1", "2", "3"]


@pytest.mark.parametrize(("least", "ticks"), [(1.1, 5), (0.001, 3)])
def test_a_logarithmic_axis_fits_the_values(least, ticks):
    lines = {"ours": ([2.0, 1.5, 1.2, least], None), "other": ([3.0, 2.8, 2.9, 2.7], None)}
    (axes,) = draw_lines("t", "x", "y", X, lines, logarithmic=True).axes
    low, high = axes.get_ylim()
    assert axes.get_yscale() == "log"
    assert 0.5 * least < low < least
    assert 3 < high < 6
    assert sum(low <= tick <= high for tick in axes.get_yticks()) >= ticks


def test_a_logarithmic_axis_is_linear_where_a_value_is_not_above_0():
    (axes,) = draw_lines("t", "x", "y", X, {"a": ([1.0, -2.0, 0.0, 1.0], None)}, logarithmic=True).axes
    assert (axes.get_yscale(), axes.get_ylim()[0]) == ("linear", -2.0)


def test_the_axis_reaches_below_nought_where_something_is_there():
    assert plot("t", "x", "y", X, {"a": ([1.0, -2.0, 0.0, 1.0], [0.0, 0.5, 0.0, 0.0])}).get_ylim()[0] == -2.5


def test_a_line_with_a_spread_has_a_band_on_both_sides_and_one_without_has_none():
    (band,) = plot("title", "x", "y", X, LINES).collections
    mean, spread = map(np.array, LINES["ours"])
    corners = {(x, round(y, 9)) for x, y in band.get_paths()[0].vertices}
    assert corners == {
        (x, round(y, 9)) for y_of in (mean - spread, mean + spread) for x, y in zip(X, y_of, strict=True)
    }
    assert band.get_alpha() == BAND


def test_a_single_x_is_a_marker_with_its_spread():
    axes = plot("title", "x", "y", [4], {"ours": ([1.0], [0.5])})
    ends = axes.collections[0].get_segments()[0]
    np.testing.assert_array_equal(ends, [(4, 0.5), (4, 1.5)])
    assert axes.lines[-1].get_marker() == "o"


def test_the_order_of_numbers_does_not_matter_and_that_of_names_does():
    turned = {name: (mean[::-1], spread and spread[::-1]) for name, (mean, spread) in LINES.items()}

    def png(x, lines):
        return encoded(draw_lines("t", "x", "y", x, lines), "png")

    assert png(X, LINES) == png(X[::-1], turned)
    names = ["small", "middle", "large", "huge"]
    assert png(names, LINES) != png(names[::-1], turned)
    axes = plot("t", "x", "y", names, LINES)
    assert [text.get_text() for text in axes.get_xticklabels()] == names


def test_numbers_stand_where_they_belong():
    (line,) = plot("t", "x", "y", [0, 1, 10], {"a": ([1.0, 1.0, 1.0], None)}).lines
    assert line.get_xdata().tolist() == [0, 1, 10]


def test_many_x_have_round_numbers_below():
    axes = plot("t", "step", "y", list(range(7, 1000, 13)), {"a": ([1.0] * 77, None)})
    ticks = axes.get_xticks()
    assert len(ticks) < 12
    assert all(tick % 100 == 0 for tick in ticks)


def test_a_line_goes_straight_past_what_was_not_measured():
    (line,) = plot("t", "x", "y", [0, 1, 2], {"a": ([1.0, math.nan, 3.0], None)}).lines
    np.testing.assert_array_equal(line.get_xydata(), [(0, 1), (2, 3)])


def test_lines_of_one_colour_differ_in_style_and_each_has_its_marker():
    lines = {f"line {k}": ([float(k)], None) for k in range(len(SERIES) + 1)}
    drawn = plot("t", "x", "y", [0], lines).lines
    assert drawn[0].get_color() == drawn[-1].get_color()
    assert drawn[0].get_linestyle() != drawn[-1].get_linestyle()
    assert len({line.get_marker() for line in drawn[:-1]}) == len(SERIES)


def test_the_legend_names_every_line_beside_the_plot():
    lines = {"_under": ([1.0, 2.0], None), "$100": ([2.0, 1.0], None), "a name " * 9: ([0.0, 0.0], None)}
    figure = draw_lines("t", "x", "y", [0, 1], lines)
    figure.canvas.draw()
    (legend,) = figure.legends
    first, second, third = (text.get_text() for text in legend.get_texts())
    assert (first, second) == ("_under", r"\$100")
    assert third.endswith("…")
    assert legend.get_window_extent().x0 >= figure.axes[0].get_window_extent().x1
    assert legend.get_window_extent().x1 <= WIDTH * DPI


def test_a_long_legend_makes_the_chart_higher():
    lines = {f"line {k}": ([float(k)], None) for k in range(40)}
    figure = draw_lines("t", "x", "y", [0], lines)
    assert figure.get_figheight() > HEIGHT + 3
    figure.canvas.draw()
    assert figure.legends[0].get_window_extent().height <= figure.get_figheight() * DPI


def test_the_file_opens_as_the_picture(tmp_path):
    line_chart("title", "x", "y", X, LINES, tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as read:
        assert read.format == "PNG"
        assert read.size == (round(WIDTH * DPI), round(HEIGHT * DPI))
    assert (tmp_path / "chart.png").read_bytes() == encoded(draw_lines("title", "x", "y", X, LINES), "png")


@pytest.mark.parametrize(
    ("x", "lines", "said"),
    [
        ([], {"a": ([], None)}, "there is no x"),
        ([1], {}, "there is no line"),
        ([math.inf], {"a": ([1.0], None)}, "an x is not finite"),
        ([1, 2], {"a": ([1.0], None)}, "line 'a' has 1 means for 2 x"),
        ([1, 2], {"a": ([1.0, 2.0], [0.1])}, "line 'a' has 1 spreads for 2 x"),
        ([1], {"a": ([math.nan], None)}, "line 'a' is not finite"),
        ([1], {"a": ([math.inf], None)}, "line 'a' is not finite"),
        ([1], {"a": ([1.0], [math.inf])}, "line 'a' is not finite"),
        ([1], {"a": ([1.0], [-1.0])}, "a spread below 0"),
    ],
)
def test_what_can_not_be_drawn_is_named_and_nothing_is_written(tmp_path, x, lines, said):
    with pytest.raises(UserError, match=f"chart 'title': .*{said}"):
        line_chart("title", "x", "y", x, lines, tmp_path / "chart.png")
    assert not list(tmp_path.iterdir())
