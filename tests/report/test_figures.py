"""The paper's Figures 4, 5 and 6 from run folders, as files and on the page of a comparison."""

import copy
import json
import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import save_file

from pcsr.errors import RunError, UserError
from pcsr.report import lettering, write_comparison, write_figures
from pcsr.report.figures import CLOSE, COLUMNS, INPUT, SIZE, TOUCH, ZOOM, _close, closeups, figures, side_by_side
from pcsr.report.figures import touches as touch_figure
from pcsr.report.gather import gather
from pcsr.report.pictures import camera
from pcsr.report.sheet import CAPTION, GAP, TITLE


def put(runs, results, clouds, history, *, name, touches):
    """A run of a network `name` in a folder that is called as `pcsr run` calls it."""
    made = copy.deepcopy(results) | {"name": name}
    made["data"]["touches"] = touches
    made["recipe"] |= {"name": name, "evaluate": {}, "train": {"epochs": 3}}
    made["recipe"]["data"] |= {"touches": touches}
    made["methods"][0]["name"] = name
    kept = {key.replace("tapsr", name): cloud for key, cloud in clouds.items()}
    kept = {key: cloud for key, cloud in kept.items() if touches or not key.endswith("touches")}
    folder = runs / f"{name}-ab12cd34"
    folder.mkdir()
    (folder / "results.json").write_text(json.dumps(made), encoding="utf-8")
    save_file(kept, folder / "examples.safetensors", {"names": json.dumps(results["objects"][:2])})
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in history), encoding="utf-8")
    return folder


@pytest.fixture
def pair(tmp_path, results, clouds, history):
    """A run without touches and one with two, on the same clouds."""
    runs = tmp_path / "runs"
    runs.mkdir()
    return [put(runs, results, clouds, history, name=f"study-net-touches.{count}", touches=count) for count in (0, 2)]


def parts(image, columns, rows, wide, high):
    """The panels of a sheet, row by row, as arrays."""
    page = np.asarray(image).astype(int)
    for i in range(rows):
        for j in range(columns):
            y, x = TITLE + i * (CAPTION + high + GAP) + CAPTION, GAP + j * (wide + GAP)
            yield page[y : y + high, x : x + wide]


def hue(panel, colour):
    """How many pixels of a panel are of a colour or paler, as far as paleness goes."""
    paler = [255 * (colour + (1 - colour) * share) for share in np.linspace(0, 0.5, 40)]
    return sum(((np.abs(panel - one) <= 4).all(-1)).sum() for one in paler)


def test_every_figure_that_there_is_something_for(pair):
    drawn = figures(pair)
    assert set(drawn) == {"closeups", "touches", "object-0", "object-1", "training", "over-touches"}


def test_without_touches_and_history_there_is_no_figure_of_them(pair):
    (pair[0] / "metrics.jsonl").unlink()
    assert set(figures(pair[:1])) == {"closeups", "object-0", "object-1"}


@pytest.mark.slow
def test_figure_4_shows_truth_then_input_and_touches_then_one_touch(pair):
    subjects = gather(pair).subjects
    image = touch_figure(subjects)
    assert image.size == (GAP + 3 * (SIZE + GAP), TITLE + 2 * (CAPTION + SIZE + GAP))
    for k, panel in enumerate(parts(image, 3, 2, SIZE, SIZE)):
        shown = (hue(panel, INPUT) > 50, hue(panel, TOUCH) > 50)
        assert shown == [(False, False), (True, True), (False, True)][k % 3]


def test_figure_5_has_a_column_for_each_object_and_a_row_for_each_network(pair):
    read = gather(pair)
    image = closeups(read.subjects, read.networks)
    wide = 2 * CLOSE + 1
    assert image.width == GAP + 2 * (wide + GAP)
    assert image.height == TITLE + 4 * (CAPTION + CLOSE + GAP) + CAPTION + GAP
    panels = list(parts(image, 2, 4, wide, CLOSE))
    assert all(hue(panel, TOUCH) > 30 for panel in panels[:2])
    assert not any(hue(panel, INPUT) > 30 for panel in panels[2:])
    np.testing.assert_array_equal(panels[2], panels[4])  # the two networks predict the same here
    assert (panels[2] != panels[3]).any()


def test_a_part_is_close_up_where_the_nearest_touch_is_and_larger(pair):
    subject = gather(pair).subjects[0]
    view = camera(subject.example.truth)
    close = _close(view, subject)
    middles = [touch.mean(0) for touch in subject.touches]
    depths = [float(view.seen(middle[None])[0, 2]) for middle in middles]
    np.testing.assert_allclose(close.centre, middles[int(np.argmax(depths))], rtol=1e-6)
    assert close.half == pytest.approx(view.half / ZOOM)
    bare = gather(pair[:1]).subjects[0]
    place = _close(view, bare).centre
    assert view.seen(place[None])[0, 2] == pytest.approx(view.seen(bare.example.truth)[:, 2].max(), abs=1e-6)


def test_figure_6_sets_truth_input_and_every_method_side_by_side(pair):
    subject = gather(pair).subjects[0]
    assert len(subject.example.predictions) == 4
    image = side_by_side(subject)
    assert image.size == (
        GAP + COLUMNS * (SIZE + GAP),
        TITLE + 2 * (CAPTION + SIZE + GAP) + CAPTION + GAP,
    )
    filled = [(panel < 200).any() for panel in parts(image, COLUMNS, 2, SIZE, SIZE)]
    assert filled == [True] * 6 + [False] * 2


def test_a_network_without_error_is_all_in_the_first_colour(tmp_path, results, clouds, history):
    perfect = {key: clouds[f"{key[0]}/truth"] if key.endswith("/tapsr") else cloud for key, cloud in clouds.items()}
    folder = put(tmp_path, results, perfect, history, name="net", touches=2)
    _, _, own, interpolated, *_ = parts(side_by_side(gather([folder]).subjects[0]), COLUMNS, 2, SIZE, SIZE)
    red = [((panel[..., 0] > 180) & (panel[..., 2] < 100)).sum() for panel in (own, interpolated)]
    assert red[0] == 0
    assert red[1] > 500


@pytest.fixture
def charts(monkeypatch):
    """What charts are asked to show: x and lines by title."""
    asked = {}

    def draw(title, x_label, y_label, x, lines):
        asked[title.partition(",")[0]] = (x, lines)
        return Image.new("RGB", (1, 1))

    monkeypatch.setattr("pcsr.report.chart.draw", draw)
    return asked


def test_curves_show_the_numbers_of_the_runs(pair, results, charts):
    (pair[1] / "metrics.jsonl").write_text('{"step": 40, "validation": {"cd": 0.002}}\n', encoding="utf-8")
    figures(pair)
    steps, lines = charts["Validation"]
    assert steps == [30, 40]
    np.testing.assert_allclose(lines["study-net-touches.0"][0], [1.1, np.nan])
    np.testing.assert_allclose(lines["study-net-touches.2"][0], [np.nan, 2.0])
    numbers, lines = charts["cd ×10³ over touches"]
    assert numbers == [0, 2]
    values = 1000 * np.array(results["methods"][0]["values"]["cd"])
    ((name, (means, spreads)),) = lines.items()
    assert name == "study-net"
    np.testing.assert_allclose(means, [values.mean()] * 2)
    np.testing.assert_allclose(spreads, [values.std(ddof=1)] * 2)


@pytest.mark.slow
def test_files_are_the_figures(pair, tmp_path):
    written = write_figures(pair, tmp_path / "out")
    drawn = figures(pair)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(f"{name}.png" for name in drawn)
    for path in written:
        with Image.open(path) as read:
            assert read.format == "PNG"
            assert read.convert("RGB") == drawn[path.stem]


def test_nothing_is_written_where_a_file_is_missing(pair, tmp_path):
    (pair[1] / "examples.safetensors").unlink()
    with pytest.raises(UserError, match=r"examples\.safetensors is missing; do `pcsr run` again"):
        write_figures(pair, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_file_that_fails_keeps_what_was_there(pair, tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "closeups.png").write_bytes(b"old")

    def full(part, encoded):
        part.write_bytes(encoded[:10])
        raise OSError("no space left")

    monkeypatch.setattr(lettering, "_write", full)
    with pytest.raises(RunError, match=r"closeups\.png could not be written"):
        write_figures(pair, out)
    assert [(path.name, path.read_bytes()) for path in out.iterdir()] == [("closeups.png", b"old")]


@pytest.mark.slow
def test_the_page_of_a_comparison_holds_the_figures(pair, results):
    runs = [json.loads((folder / "results.json").read_text(encoding="utf-8")) for folder in pair]
    text = write_comparison(runs, "study", pair[0].parent).read_text(encoding="utf-8")
    shown = re.findall(r'<img alt="([^"]+)"[^>]* src="data:image/png;base64,([^"]+)">', text)
    assert {name for name, _ in shown} == set(figures(pair))
    with Image.open(BytesIO(b64decode(dict(shown)["object-0"]))) as image:
        assert image.size == figures(pair)["object-0"].size
    assert "http" not in re.sub(r"base64,[^\"]+", "", text), "nothing is fetched"


def test_the_page_says_why_there_is_no_figure(pair):
    runs = [json.loads((folder / "results.json").read_text(encoding="utf-8")) for folder in pair]
    (pair[0] / "examples.safetensors").unlink()
    text = write_comparison(runs, "study", pair[0].parent).read_text(encoding="utf-8")
    assert "<img" not in text
    assert "examples.safetensors is missing" in text
