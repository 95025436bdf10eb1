"""Panels in rows, each with its caption; and the scale of errors."""

import numpy as np
import pytest

from pcsr.report.figures.canvas import DPI, encoded
from pcsr.report.figures.clouds import Camera, Layer
from pcsr.report.figures.panels import BAR, CAPTION, GAP, TITLE, Panel, letter, panel_figure

FRONT = Camera(np.eye(3), np.zeros(3), 1.0)


def panel(caption, close=None):
    layers = [Layer(np.zeros((1, 3)), np.array([1.0, 0.0, 0.0]), 0.1)]
    return Panel(caption, FRONT, layers, close, layers if close else ())


def boxes(figure):
    """Left, bottom, width and height of each plot, in inches."""
    figure.draw_without_rendering()
    size = figure.get_size_inches()
    return [np.array(axes.get_position().bounds) * np.tile(size, 2) for axes in figure.axes]


def test_panels_are_square_and_stand_in_rows():
    figure = panel_figure("title", [[panel("a"), panel("b"), panel("c")], [panel("d")]], 2.0)
    assert figure.get_size_inches() == pytest.approx((GAP + 3 * (2 + GAP), TITLE + 2 * (CAPTION + 2 + GAP)))
    found = boxes(figure)
    np.testing.assert_allclose([box[2:] for box in found], [(2, 2)] * 4)
    lefts = [GAP + k * (2 + GAP) for k in (0, 1, 2, 0)]
    np.testing.assert_allclose([box[0] for box in found], lefts)
    assert found[0][1] == pytest.approx(found[2][1])
    assert found[0][1] - found[3][1] == pytest.approx(CAPTION + 2 + GAP)


def test_every_panel_has_its_caption_above_it():
    figure = panel_figure("the title", [[panel("first"), panel("second")]], 2.0)
    title, *captions = figure.texts
    assert title.get_text() == "the title"
    assert [one.get_text() for one in captions] == ["first", "second"]
    size = figure.get_size_inches()
    for caption, box in zip(captions, boxes(figure), strict=True):
        extent = caption.get_window_extent().bounds / np.tile(size * DPI, 2) * np.tile(size, 2)
        assert extent[0] == pytest.approx(box[0], abs=0.05)
        assert box[1] + box[3] < extent[1] < extent[1] + extent[3] < box[1] + box[3] + CAPTION


def test_a_long_caption_does_not_reach_into_the_next_panel():
    figure = panel_figure("t", [[panel("W" * 300), panel("b")]], 2.0)
    figure.draw_without_rendering()
    right = figure.texts[1].get_window_extent().x1 / DPI
    assert right < GAP + 2 * 2 + 2 * GAP


def test_errors_have_a_scale_and_what_is_not_coloured_has_none():
    without, figure = panel_figure("t", [[panel("a")]], 3.0), panel_figure("t", [[panel("a")]], 3.0, 2.5)
    assert len(without.axes) == 1
    assert figure.get_figheight() == pytest.approx(without.get_figheight() + BAR)
    bar = figure.axes[-1]
    assert bar.get_xlim() == (0, 2.5)
    assert "×10⁻³ radii" in bar.get_xlabel()
    figure.draw_without_rendering()
    assert bar.get_tightbbox().x0 >= 0
    assert bar.get_tightbbox().y0 >= 0
    assert bar.get_tightbbox().y1 <= figure.axes[0].get_window_extent().y0


def test_a_close_up_is_beside_and_framed_in_the_whole():
    close = FRONT.closer(np.array([0.5, 0.25, 0.0]), 0.25)
    figure = panel_figure("t", [[panel("a", close)]], 2.0)
    whole, beside = boxes(figure)
    np.testing.assert_allclose(beside - whole, (2, 0, 0, 0), atol=1e-9)
    frame = figure.axes[0].lines[-1].get_xydata()
    np.testing.assert_allclose([frame.min(0), frame.max(0)], [(0.25, 0.0), (0.75, 0.5)])
    assert figure.axes[1].get_xlim() == (-0.25, 0.25)
    encoded(figure, "png")


def test_letters_go_on_after_z():
    assert [letter(k) for k in (0, 25, 26, 27, 52)] == ["a", "z", "aa", "ab", "ba"]
