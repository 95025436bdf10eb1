"""Figures as files, their text, and the colours of errors."""

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from pcsr.errors import UserError
from pcsr.report.colours import ERROR_SCALE, SERIES
from pcsr.report.figures.canvas import DPI, encoded, error_bar, error_colours, label, new_figure


def rgb(colour):
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]


def drawn(text=""):
    figure = new_figure(2.0, 1.0)
    figure.text(0.1, 0.5, text)
    return figure


@pytest.mark.parametrize("form", ["png", "webp"])
def test_a_file_has_the_size_of_the_figure_and_equal_figures_give_equal_bytes(form):
    data = encoded(drawn("text"), form)
    with Image.open(BytesIO(data)) as image:
        assert (image.format, image.size) == (form.upper(), (2 * DPI, DPI))
        assert not {"Software", "Creation Time", "date"} & set(image.info), "no version and no date"
    assert encoded(drawn("text"), form) == data
    assert encoded(drawn("other"), form) != data


def test_a_page_takes_less_room_than_a_file():
    figure = new_figure(4.0, 4.0)
    points = np.random.default_rng(0).normal(size=(2, 3000))
    figure.add_subplot().scatter(*points, c=points[0])
    assert len(encoded(figure, "webp")) < len(encoded(figure, "png")) / 2


@pytest.mark.parametrize("text", ["cd ×10⁻³", "×10¹²", "0.1 ± 0.2", "a–b", "…"])
def test_every_letter_of_the_report_is_in_the_font(text):
    encoded(drawn(label(text, 20)), "png")  # a letter that is missing is warned of, and a warning is an error here


@pytest.mark.parametrize("text", ["a$b", "$a$", r"\frac$x_y$", r"\$", "$$$", "_a", "{", "%", "$\\"])
def test_no_name_is_a_formula(text):
    figure = drawn(label(text, 20))
    encoded(figure, "png")
    shown = figure.texts[0]
    assert shown._preprocess_math(shown.get_text()) == (text, False)


def test_a_text_is_wrapped_and_cut_where_it_is_too_long():
    long = "a name that goes on and on"
    assert label(long, 100) == long
    assert label(long, 14).replace("\n", " ") == long
    cut = label("word" * 30, 14)
    assert cut.endswith("…")
    assert len(cut.splitlines()) == 2
    assert max(map(len, cut.splitlines())) == 14


@given(st.lists(st.floats(0, 10), min_size=2, max_size=30), st.floats(0.1, 10))
def test_the_colours_of_errors_are_in_the_order_of_the_errors(errors, end):
    colours = error_colours(np.sort(np.array(errors)), end)
    assert (np.diff(colours[:, 2]) <= 1e-12).all(), "there is ever less blue along the scale"


def test_the_scale_begins_and_ends_with_its_colours():
    found = error_colours(np.array([0.0, 1.0, 2.0, 9.0]), 2.0)
    wanted = np.array([rgb(colour) for _, colour in [*ERROR_SCALE, ERROR_SCALE[-1]]])
    np.testing.assert_allclose(found, wanted, atol=0.01)
    assert len(np.unique(error_colours(np.linspace(0, 2, 50), 2.0), axis=0)) == 50


def test_the_scale_of_errors_is_a_bar_with_a_label():
    figure = new_figure(4.0, 1.0)
    error_bar(figure, (0.1, 0.5, 0.8, 0.2), 2.5, "distance, ×10⁻³")
    (axes,) = figure.axes
    assert axes.get_xlim() == (0, 2.5)
    assert axes.get_xlabel() == "distance, ×10⁻³"


def lightness(colour):
    """CIE L* of an sRGB colour."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
    y = np.dot((0.2126, 0.7152, 0.0722), linear)
    return 116 * np.cbrt(y) - 16


def deuteranope(colour):
    """An sRGB colour as seen without green cones (Viénot, Brettel and Mollon 1999)."""
    seen = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]) @ np.array(colour)
    return np.clip(seen, 0, 1)


def test_errors_can_be_ordered_without_seeing_colours():
    colours = error_colours(np.linspace(0, 1, 20), 1.0)
    for seen in (colours, [deuteranope(colour) for colour in colours]):
        assert (np.diff([lightness(colour) for colour in seen]) < 0).all()


def test_the_first_series_differ_for_who_sees_no_green():
    seen = [deuteranope(rgb(colour)) for colour in SERIES]
    apart = [np.linalg.norm(a - b) for k, a in enumerate(seen) for b in seen[:k]]
    assert min(apart) > 0.1


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("pcsr.extras.installed", lambda package: package != "matplotlib")
    with pytest.raises(
        UserError, match=r"a figure needs matplotlib, which is not installed: pip install 'pcsr\[report"
    ):
        new_figure(1.0, 1.0)
