"""The page of a calibration: every press with its circle, the figures, the refused presses; nothing from elsewhere."""

import re
from functools import cache

import pytest

from pcsr.report.web.calibration_page import calibration_page
from pcsr.sensors import Gel, PressImage, calibrate
from tests.sensors.synthetic import PITCH, background, presses


@cache
def page(count=9):
    given = [*presses(), PressImage("<untouched> & more.png", background(3), 6.0)]
    made = calibrate(given, background(), mm_per_pixel=PITCH, sensor="<mine>", gel=Gel(), count=count)
    return made, calibration_page(made, given, background())


def test_each_press_has_its_picture_and_circle_the_worst_first():
    made, text = page()
    figures = re.findall(
        r'<svg viewBox="0 0 160 120"[^>]*><image href="data:image/jpeg[^>]*/><circle cx="([\d.]+)" cy="([\d.]+)" '
        r'r="([\d.]+)"[^>]*/></svg><figcaption>(\S+), 6 mm: ([\d.]+)°</figcaption>',
        text,
    )
    assert {name for *_, name, _ in figures} == made.places.keys()
    assert len(figures) == 9
    angles = [float(angle) for *_, angle in figures]
    assert angles == sorted(angles, reverse=True)
    for x, y, rim, name, _ in figures:
        place = made.places[name]
        assert (float(x), float(y)) == pytest.approx(tuple(place.centre + 0.5), abs=0.06)
        assert float(rim) == pytest.approx(place.rim, abs=0.06)
    assert text.count("<circle ") == 2 * 9


def test_figures_and_refused_presses_are_listed():
    made, text = page()
    assert "errors on 3 presses that are not used in the fit" in text
    for press in made.held_out:
        assert f'<th scope="row">{press.name}</th><td>6</td><td>{100 * (press.radius_ratio - 1):+.1f}</td>' in text
    assert '<th scope="row">&lt;untouched&gt; &amp; more.png</th><td>no ball: the colour changes by' in text
    assert "<h1>Calibration of &lt;mine&gt;</h1>" in text
    assert "<mine>" not in text
    assert "<untouched>" not in text


def test_the_page_needs_nothing_from_elsewhere_and_is_small():
    _, text = page()
    assert "http" not in text
    assert "<script" not in text
    assert len(text) / 9 < 5e6 / 50
