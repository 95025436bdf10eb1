import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from pcsr.errors import UserError
from pcsr.report.chart import BAND, HEIGHT, WIDTH, draw, line_chart, ticks
from pcsr.report.curves import COLOURS
from pcsr.report.lettering import rgb

X = [0, 1, 2, 3]
LINES = {"ours": ([2.0, 1.5, 1.2, 1.1], [0.4, 0.3, 0.2, 0.1]), "other": ([3.0, 2.8, 2.9, 2.7], None)}
PLOT = (slice(48, 380), slice(80, 600))
"""Where lines are, and neither the legend nor labels."""


def where(image, colour, tolerance=1):
    """Rows and columns of the pixels of a colour, inside of the plot."""
    pixels = np.asarray(image).astype(int)[PLOT]
    return np.argwhere((np.abs(pixels - np.array(colour)) <= tolerance).all(-1))


def tinted(colour):
    """What a band looks like on white."""
    return [round(255 + BAND * (part - 255)) for part in rgb(colour)]


def test_each_line_is_there_in_its_colour_and_reaches_from_the_first_x_to_the_last():
    image = draw("title", "x", "y", X, LINES)
    assert image.size == (WIDTH, HEIGHT)
    for colour in COLOURS[:2]:
        columns = where(image, rgb(colour))[:, 1]
        assert len(columns) > 200
        assert np.ptp(columns) > 450
    assert not len(where(image, rgb(COLOURS[2])))


def test_what_is_greater_is_higher():
    image = draw("title", "x", "y", X, LINES)
    ours, other = (where(image, rgb(colour)) for colour in COLOURS[:2])
    assert other[:, 0].max() < ours[:, 0].min()
    first = [rows[rows[:, 1] < 30, 0].mean() for rows in (ours, other)]
    last = [rows[rows[:, 1] > 400, 0].mean() for rows in (ours, other)]
    assert last[0] - first[0] > last[1] - first[1] > 0, "both fall, the first farther"


def test_a_line_with_a_spread_has_a_band_on_both_sides_and_one_without_has_none():
    image = draw("title", "x", "y", X, LINES)
    band = where(image, tinted(COLOURS[0]), 2)
    line = where(image, rgb(COLOURS[0]))
    assert len(band) > 2000
    assert band[:, 0].min() < line[:, 0].min() - 5
    assert band[:, 0].max() > line[:, 0].max() + 5
    assert len(where(image, tinted(COLOURS[1]), 2)) < 100
    wide = {"ours": (LINES["ours"][0], [2 * one for one in LINES["ours"][1]])}
    narrow = {"ours": LINES["ours"]}
    areas = [len(where(draw("t", "x", "y", X, one), tinted(COLOURS[0]), 2)) for one in (narrow, wide)]
    assert areas[1] > 1.3 * areas[0]


def test_a_single_x_is_a_marker_with_its_spread():
    image = draw("title", "x", "y", [4], {"ours": ([1.0], [0.5])})
    assert 20 < len(where(image, rgb(COLOURS[0]))) < 100
    assert len(where(image, tinted(COLOURS[0]), 2)) > 500


def test_the_order_of_numbers_does_not_matter_and_that_of_names_does():
    turned = {name: (mean[::-1], spread and spread[::-1]) for name, (mean, spread) in LINES.items()}
    assert draw("t", "x", "y", X, LINES) == draw("t", "x", "y", X[::-1], turned)
    names = ["small", "middle", "large", "huge"]
    assert draw("t", "x", "y", names, LINES) != draw("t", "x", "y", names[::-1], turned)


def test_numbers_stand_where_they_belong():
    uneven = draw("t", "x", "y", [0, 1, 10], {"a name of some length": ([1.0, 1.0, 1.0], [0.4, 0.4, 0.4])})
    heights = np.bincount(where(uneven, rgb(COLOURS[0]))[:, 1])
    markers = np.flatnonzero(heights >= 5)
    starts = markers[np.diff(markers, prepend=-10) > 3]
    first, second, third = starts[:3]  # and then the one in the legend
    assert (second - first) / (third - first) == pytest.approx(0.1, abs=0.02)


def test_a_line_goes_straight_past_what_was_not_measured():
    gap = draw("t", "x", "y", [0, 1, 2], {"a": ([1.0, math.nan, 3.0], None)})
    full = draw("t", "x", "y", [0, 1, 2], {"a": ([1.0, 2.0, 3.0], None)})
    lengths = [len(where(image, rgb(COLOURS[0]))) for image in (gap, full)]
    assert lengths[0] > 0.8 * lengths[1]
    assert lengths[0] < lengths[1], "there is no marker in between"


def test_colours_come_round_with_other_markers():
    lines = {f"line {k}": ([float(k)], None) for k in range(len(COLOURS) + 1)}
    rows = where(draw("t", "x", "y", [0], lines), rgb(COLOURS[0]))
    upper, lower = rows[rows[:, 0] < 150], rows[rows[:, 0] >= 150]
    assert len(upper) > 10
    assert len(lower) > 10
    assert len(upper) != len(lower)


def test_a_long_legend_makes_the_chart_higher():
    lines = {f"line {k}": ([float(k)], None) for k in range(40)}
    assert draw("t", "x", "y", [0], lines).height > HEIGHT + 300


def test_the_file_opens_as_the_picture(tmp_path):
    line_chart("title", "x", "y", X, LINES, tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as read:
        assert read.format == "PNG"
        assert read.convert("RGB") == draw("title", "x", "y", X, LINES)


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


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_few_even_and_hold_both_ends(low, width):
    high = low + width
    if width < 1e-6 * abs(low):
        return
    found = ticks(low, high)
    steps = np.diff(found)
    assert 2 <= len(found) <= 8
    np.testing.assert_allclose(steps, steps[0], rtol=1e-2)
    slack = 1e-6 * max(width, abs(low))
    assert found[0] <= low + slack
    assert found[-1] >= high - slack
    inner = ticks(low, high, whole=False)
    assert all(low - slack <= one <= high + slack for one in inner)


def test_ticks_are_round():
    assert ticks(0, 2.3) == [0, 0.5, 1, 1.5, 2, 2.5]
    assert ticks(0, 5) == [0, 1, 2, 3, 4, 5]
    assert ticks(3, 3) == [3]
