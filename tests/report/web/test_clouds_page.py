"""The page of any clouds: its views, their colours, and the words around them."""

import json
import re

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds.shown import Named, scene
from pcsr.report.colours import CLASSES, MARK, VALUE_SCALE
from pcsr.report.web.clouds_page import ROW, clouds_page

POINTS = np.random.default_rng(0).uniform(size=(40, 3)) * 8 + (450_000, 5_400_000, 200)


def page_of(*clouds, by=None, touches=()):
    """The page's HTML without its data, and its views."""
    text = clouds_page(scene([Named(*one) for one in clouds], by, touches), plotly="var Plotly;")
    data = re.search(r'<script type="application/json" id="drawn">(.*?)</script>', text)[1]
    examples = json.loads(data)["examples"]
    return text.replace(data, ""), examples


def cloud(**columns):
    return Cloud(POINTS, columns)


def points(*traces):
    return np.concatenate([np.stack([trace[axis] for axis in "xyz"], 1) for trace in traces])


def test_clouds_of_one_frame_keep_their_places_beside_each_other():
    _, (row,) = page_of(("a", cloud()), ("b", Cloud(POINTS[:20] + 1)))
    first, second = (points(*view["traces"]) for view in row["views"])
    assert [view["title"] for view in row["views"]] == ["a, 40 points", "b, 20 points"]
    assert row["range"] == [[-1, 1]] * 3
    assert np.abs(np.vstack([first, second])).max() <= 1
    half = np.ptp(POINTS[:, 0]) / np.ptp(first[:, 0])
    np.testing.assert_allclose(second - first[:20], 1 / half, atol=2e-4)


def test_each_point_has_its_own_colour():
    colours = np.random.default_rng(0).integers(0, 256, (40, 3), np.uint8)
    _, (row,) = page_of(("a", cloud(**dict(zip(("red", "green", "blue"), colours.T, strict=True)))))
    (trace,) = row["views"][0]["traces"]
    assert trace["marker"]["color"] == ["#" + bytes(colour).hex() for colour in colours]


def test_numbers_are_on_one_scale_with_its_bar():
    heat = np.linspace(-2, 7.5, 40)
    page, (row,) = page_of(("a", cloud(heat=heat)), ("b", cloud(heat=heat / 2)), ("c", cloud()), by="heat")
    shown = [view["traces"] for view in row["views"]]
    for (trace,), values in zip(shown, (heat, heat / 2), strict=False):
        np.testing.assert_allclose(trace["marker"]["color"], values, rtol=1e-4)
        assert (trace["marker"]["cmin"], trace["marker"]["cmax"]) == (-2, 7.5)
        assert trace["marker"]["colorscale"] == [list(stop) for stop in VALUE_SCALE]
    assert shown[2][0]["marker"]["color"] == "truth", "a cloud without the column has one colour"
    assert re.search(r"<span>heat</span><span>-2</span><i .*?></i><span>7.5</span>", page)


def test_points_without_a_number_are_grey():
    heat = np.r_[np.linspace(0, 1, 38) ** 2, np.nan, np.inf]
    _, (row,) = page_of(("a", cloud(heat=heat)), by="heat")
    on_scale, grey = row["views"][0]["traces"]
    assert (len(on_scale["x"]), len(grey["x"]), grey["marker"]["color"]) == (38, 2, "quiet")


def test_a_column_of_one_number_has_a_scale():
    _, (row,) = page_of(("a", cloud(heat=np.full(40, 0.25))), by="heat")
    marker = row["views"][0]["traces"][0]["marker"]
    assert marker["cmin"] < 0.25 < marker["cmax"]


def test_labels_have_a_legend():
    label = np.repeat([6.0, 2.0], 20)
    page, (row,) = page_of(("a", cloud(label=label)), by="label")
    traces = row["views"][0]["traces"]
    assert [trace["marker"]["color"] for trace in traces] == CLASSES[:2]
    assert [trace["hovertemplate"] for trace in traces] == ["2<extra></extra>", "6<extra></extra>"]
    (two, _), (_, six) = traces, traces
    assert np.ptp(points(two)) > 0
    assert (len(two["x"]), len(six["x"])) == (20, 20)
    legend = re.findall(r'<li><i style="background: (.*?)"></i>(.*?)</li>', page)
    assert legend == [(CLASSES[0], "2"), (CLASSES[1], "6")]


def test_old_new_and_touched_points_have_the_colours_of_the_reports():
    page, (row,) = page_of(("a", cloud(source=np.repeat([0, 1, 2], [10, 25, 5]))))
    (view,) = row["views"]
    assert view["title"] == "a, 40 points: 10 old, 25 new, 5 touched"
    assert [(trace["marker"]["color"], len(trace["x"])) for trace in view["traces"]] == [
        ("truth", 10), ("input", 25), ("touch", 5),
    ]  # fmt: skip
    legend = re.findall(r'<li><i style="background: (.*?)"></i>(.*?)</li>', page)
    assert legend == [("var(--truth)", "old"), ("var(--input)", "new"), ("var(--touch)", "touched")]


def test_touches_are_in_every_view_and_in_the_legend():
    page, (row,) = page_of(("a", cloud()), ("b", cloud()), touches=[POINTS[:7], POINTS[7:9]])
    for view in row["views"]:
        assert (view["traces"][-1]["marker"]["color"], len(view["traces"][-1]["x"])) == (MARK, 9)
    assert f'<li><i style="background: {MARK}"></i>recorded touches, 9 points</li>' in page


def test_names_are_no_markup():
    name = 'a & <b>"</script><script>alert(1)</script>'
    label = {"<i>label</i>": np.repeat([0, 1], 20)}
    page, (row,) = page_of((name, cloud(**label)), by="<i>label</i>")
    assert row["views"][0]["title"].startswith(name)
    assert "<b>" not in page
    assert "<i>label" not in page
    assert "alert(1)</script>" not in page
    assert "&lt;i&gt;label&lt;/i&gt;" in page


@pytest.mark.parametrize(("count", "rows"), [(1, 1), (ROW, 1), (ROW + 1, 2), (3 * ROW, 3)])
def test_many_clouds_take_several_rows(count, rows):
    page, examples = page_of(*((f"{k}.ply", cloud()) for k in range(count)))
    assert [len(row["views"]) for row in examples] == [min(ROW, count - k) for k in range(0, count, ROW)]
    assert len(re.findall(r"data-example=", page)) == (rows if rows > 1 else 0)


def test_the_table_has_sizes_and_places_and_the_notes_are_there():
    page, _ = page_of(("a", Cloud(np.vstack([POINTS, [[1e10, 5.4e6 + 4, 204]]]))))
    assert "a: 1 point is far away and is not shown" in page
    assert '<th scope="row">a</th><td>41</td><td>40</td>' in page
    assert f"{POINTS[:, 0].min():.9g}, {POINTS[:, 1].min():.9g}, {POINTS[:, 2].min():.9g}" in page


def test_the_page_needs_no_network():
    page, _ = page_of(("a", cloud()))
    assert not re.findall(r"(?:src|href)=|@import|url\(", page)
