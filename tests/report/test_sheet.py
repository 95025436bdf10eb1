import numpy as np

from pcsr.report.pictures import error_colours
from pcsr.report.sheet import BAR, CAPTION, GAP, TITLE, Panel, sheet


def panel(grey, high=30, wide=40):
    return Panel(f"grey {grey}", np.full((high, wide, 3), grey, np.uint8))


def middle(page, row, column, high=30, wide=40):
    x, y = GAP + column * (wide + GAP) + wide // 2, TITLE + row * (CAPTION + high + GAP) + CAPTION + high // 2
    return page.getpixel((x, y))[0]


def test_panels_stand_in_rows():
    page = sheet("title", [[panel(10), panel(20), panel(30)], [panel(40)]])
    assert page.size == (GAP + 3 * (40 + GAP), TITLE + 2 * (CAPTION + 30 + GAP))
    assert [middle(page, 0, k) for k in range(3)] == [10, 20, 30]
    assert [middle(page, 1, k) for k in range(3)] == [40, 255, 255]


def test_every_panel_has_its_caption():
    page = np.asarray(sheet("title", [[panel(10), panel(20)]]))
    captions = page[TITLE : TITLE + CAPTION - 1]
    assert (captions[:, GAP : GAP + 40] < 200).any()
    assert (captions[:, 2 * GAP + 40 :] < 200).any()
    assert (page[:TITLE] < 100).any(), "and the whole has a title"


def test_errors_have_a_scale_and_what_is_not_coloured_has_none():
    rows = [[panel(10, wide=400)]]
    without, page = sheet("title", rows), sheet("title", rows, 2.5)
    assert page.height == without.height + CAPTION + GAP
    strip = np.asarray(page)[page.height - CAPTION + BAR[1] // 2, GAP + 16 : GAP + 16 + BAR[0]]
    np.testing.assert_allclose(strip, 255 * error_colours(np.linspace(0, 2.5, BAR[0]), 2.5), atol=0.51)
    coloured = [np.ptp(np.asarray(one).astype(int), axis=-1).max() > 60 for one in (without, page)]
    assert coloured == [False, True]
