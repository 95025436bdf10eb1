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

from pcsr import report
from pcsr.errors import RunError, UserError
from pcsr.report.cloud_errors import distance, scale_end
from pcsr.report.colours import ERROR_SCALE, INPUT, SERIES, TOUCH
from pcsr.report.figures import paper
from pcsr.report.figures.canvas import encoded, error_colours
from pcsr.report.figures.clouds import camera
from pcsr.report.figures.paper import CLOSE, COLUMNS, SIZE, ZOOM, closeup_camera, closeups, side_by_side
from pcsr.report.run_set import run_set
from pcsr.run_files import read_run


def gather(folders):
    return run_set([read_run(folder) for folder in folders])


def figures(folders):
    return paper.figures(gather(folders))


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


def rgb(colour):
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def squares(figure):
    """The plots of clouds, without the scale of errors."""
    return [axes for axes in figure.axes if axes.collections and axes.get_aspect() == 1]


def colours(axes):
    (points,) = axes.collections
    return points.get_facecolors()[:, :3]


def hue(axes, colour):
    """How many points are of a colour or paler, as far as paleness goes."""
    paler = [rgb(colour) + (1 - rgb(colour)) * share for share in np.linspace(0, 0.5, 400)]
    return sum((np.abs(colours(axes)[:, None] - paler) <= 2e-3).all(-1).any(1))


def captions(figure):
    return [text.get_text().replace("\n", " ") for text in figure.texts]


def test_every_figure_that_there_is_something_for(pair):
    drawn = figures(pair)
    assert set(drawn) == {"closeups", "touches", "object-0", "object-1", "training", "over-touches"}


def test_the_page_of_a_comparison_has_the_clouds_of_one_seed_of_each_row(
    tmp_path, results, clouds, history, monkeypatch
):
    runs = []
    for name, epochs in (("net", 3), ("other", 4)):
        for seed in (1, 0):
            folder = put(tmp_path, results, clouds, history, name=f"{name}-seed.{seed}", touches=2)
            made = json.loads((folder / "results.json").read_text(encoding="utf-8"))
            made["seed"], made["recipe"]["train"]["epochs"] = seed, epochs
            (folder / "results.json").write_text(json.dumps(made), encoding="utf-8")
            runs.append(read_run(folder))
    seen = []
    monkeypatch.setattr(
        paper, "closeups", lambda examples, networks: seen.append(networks) or closeups(examples, networks)
    )
    compared = report.comparison([run.results for run in runs], "study")
    page = report.write_comparison(compared, runs, tmp_path).read_text(encoding="utf-8")
    assert seen == [["net-seed.0", "other-seed.0"]]
    assert "Clouds are those of the first seed of each row" in page


def test_without_touches_and_history_there_is_no_figure_of_them(pair):
    (pair[0] / "metrics.jsonl").unlink()
    assert set(figures(pair[:1])) == {"closeups", "object-0", "object-1"}


def test_figure_4_shows_truth_then_input_and_touches_then_one_touch(pair):
    figure = paper.touches(gather(pair).examples)
    panels = squares(figure)
    assert len(panels) == 2 * 3
    for k, panel in enumerate(panels):
        shown = (hue(panel, INPUT), hue(panel, TOUCH))
        assert shown == [(0, 0), (64, 30), (0, 15)][k % 3]
        assert len(colours(panel)) == [256, 94, 15][k % 3]
    assert captions(figure)[1:4] == [
        "(a) test/gear/0000, 256 points",
        "(b) input, 64 points, 2 touches",
        "(c) the first touch, 15 points",
    ]


def test_figure_5_has_a_column_for_each_object_and_a_row_for_each_network(pair):
    read = gather(pair)
    figure = closeups(read.examples, read.networks)
    panels = squares(figure)
    assert len(panels) == 2 * 2 * 4, "cloud and close-up of two objects, in four rows"
    wholes, parts = panels[::2], panels[1::2]
    assert all(hue(panel, TOUCH) == 30 for panel in wholes[:2])
    assert all(hue(panel, TOUCH) >= 1 for panel in parts[:2])
    assert not any(hue(panel, INPUT) for panel in panels[4:])
    np.testing.assert_array_equal(colours(wholes[2]), colours(wholes[4]))  # the two networks predict the same here
    assert (colours(wholes[2]) != colours(wholes[3])).any()
    size = np.tile(figure.get_size_inches(), 2)
    np.testing.assert_allclose([(axes.get_position().bounds * size)[2:] for axes in panels], [(CLOSE, CLOSE)] * 16)
    for whole, part in zip(wholes, parts, strict=True):
        assert np.ptp(whole.get_xlim()) == pytest.approx(ZOOM * np.ptp(part.get_xlim()))
    errors = [
        1000 * distance(one.example.predictions[name], one.example.truth)
        for one in read.examples
        for name in read.networks
    ]
    assert figure.axes[-1].get_xlim()[1] == pytest.approx(scale_end(errors))


def test_a_part_is_close_up_where_the_nearest_touch_is_and_larger(pair):
    shared = gather(pair).examples[0]
    view = camera(shared.example.truth)
    close = closeup_camera(view, shared)
    middles = [touch.mean(0) for touch in shared.touches]
    depths = [float(view.seen(middle[None])[0, 2]) for middle in middles]
    np.testing.assert_allclose(close.centre, middles[int(np.argmax(depths))], rtol=1e-6)
    assert close.half == pytest.approx(view.half / ZOOM)
    bare = gather(pair[:1]).examples[0]
    centre = closeup_camera(view, bare).centre
    assert view.seen(centre[None])[0, 2] == pytest.approx(view.seen(bare.example.truth)[:, 2].max(), abs=1e-6)


def test_figure_6_sets_truth_input_and_every_method_side_by_side(pair):
    shared = gather(pair).examples[0]
    assert len(shared.example.predictions) == 4
    figure = side_by_side(shared)
    panels = squares(figure)
    assert [len(colours(panel)) for panel in panels] == [256, 94, 256, 256, 256, 256]
    rows = [round(axes.get_position().y0, 6) for axes in panels]
    assert len(set(rows[:COLUMNS])) == 1
    assert len(set(rows[COLUMNS:])) == 1
    assert rows[0] > rows[-1]
    size = np.tile(figure.get_size_inches(), 2)
    np.testing.assert_allclose([(axes.get_position().bounds * size)[2:] for axes in panels], [(SIZE, SIZE)] * 6)
    title, *labels = captions(figure)
    assert title == "test/gear/0000"
    assert labels[:2] == ["(a) truth, 256 points", "(b) input, 64 points, 2 touches"]
    for letter, caption, (name, cloud) in zip("cdef", labels[2:], shared.example.predictions.items(), strict=True):
        mean = 1000 * distance(cloud, shared.example.truth).mean()
        assert caption == f"({letter}) {name}, mean distance to the truth {mean:.3g} ×10⁻³"


def test_the_colour_of_a_point_is_its_error(pair):
    shared = gather(pair).examples[0]
    figure = side_by_side(shared)
    cloud = shared.example.predictions["midpoint"]
    errors = 1000 * distance(cloud, shared.example.truth)
    order = np.argsort(camera(shared.example.truth).seen(cloud)[:, 2], kind="stable")
    end = figure.axes[-1].get_xlim()[1]
    np.testing.assert_allclose(colours(squares(figure)[4]), error_colours(errors, end)[order], atol=1e-9)


def test_a_network_without_error_is_all_in_the_first_colour(tmp_path, results, clouds, history):
    perfect = {key: clouds[f"{key[0]}/truth"] if key.endswith("/tapsr") else cloud for key, cloud in clouds.items()}
    folder = put(tmp_path, results, perfect, history, name="net", touches=2)
    _, _, own, interpolated, *_ = squares(side_by_side(gather([folder]).examples[0]))
    np.testing.assert_allclose(colours(own), np.tile(rgb(ERROR_SCALE[0][1]), (256, 1)), atol=1e-6)
    assert (np.abs(colours(interpolated) - rgb(ERROR_SCALE[0][1])) > 0.1).any(1).sum() > 100


@pytest.fixture
def charts(monkeypatch):
    """What charts are asked to show: x, lines and their colours by title."""
    asked = {}

    def draw(title, x_label, y_label, x, lines, colours, *, logarithmic=False):
        asked[title.partition(",")[0]] = (x, lines, colours)

    monkeypatch.setattr("pcsr.report.figures.curves.draw_lines", draw)
    return asked


def test_curves_show_the_numbers_of_the_runs(pair, results, charts):
    (pair[1] / "metrics.jsonl").write_text('{"step": 40, "validation": {"cd": 0.002}}\n', encoding="utf-8")
    figures(pair)
    steps, lines, colours = charts["Validation"]
    assert steps == [30, 40]
    assert colours == SERIES[:2], "as the rows of a comparison"
    np.testing.assert_allclose(lines["study-net-touches.0"][0], [1.1, np.nan])
    np.testing.assert_allclose(lines["study-net-touches.2"][0], [np.nan, 2.0])
    numbers, lines, colours = charts["cd ×10³ over touches"]
    assert numbers == [0, 2]
    assert colours == SERIES[:1]
    values = 1000 * np.array(results["methods"][0]["values"]["cd"])
    ((name, (means, spreads)),) = lines.items()
    assert name == "study-net"
    np.testing.assert_allclose(means, [values.mean()] * 2)
    np.testing.assert_allclose(spreads, [values.std(ddof=1)] * 2)


def test_files_are_the_figures(pair, tmp_path):
    written = report.write_figures([read_run(folder) for folder in pair], tmp_path / "out")
    drawn = figures(pair)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(f"{name}.png" for name in drawn)
    for path in written:
        with Image.open(path) as read:
            assert read.format == "PNG"
        assert path.read_bytes() == encoded(drawn[path.stem], "png"), "drawn twice, and the same to the byte"


def test_nothing_is_written_where_a_file_is_missing(pair, tmp_path):
    (pair[1] / "examples.safetensors").unlink()
    with pytest.raises(UserError, match=r"examples\.safetensors is missing; do `pcsr run` again"):
        report.write_figures([read_run(folder) for folder in pair], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_file_that_fails_keeps_what_was_there(pair, tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "closeups.png").write_bytes(b"old")

    def full(part, encoded):
        part.write_bytes(encoded[:10])
        raise OSError("no space left")

    monkeypatch.setattr("pcsr.files._write_bytes", full)
    with pytest.raises(RunError, match=r"closeups\.png could not be written"):
        report.write_figures([read_run(folder) for folder in pair], out)
    assert [(path.name, path.read_bytes()) for path in out.iterdir()] == [("closeups.png", b"old")]


def test_the_page_of_a_comparison_holds_the_figures(pair):
    runs = [read_run(folder) for folder in pair]
    compared = report.comparison([run.results for run in runs], "study")
    text = report.write_comparison(compared, runs, pair[0].parent).read_text(encoding="utf-8")
    shown = dict(re.findall(r'<img alt="([^"]+)"[^>]* src="data:image/webp;base64,([^"]+)">', text))
    drawn = figures(pair)
    assert shown.keys() == drawn.keys()
    with Image.open(BytesIO(b64decode(shown["object-0"]))) as image:
        assert image.size == drawn["object-0"].canvas.get_width_height()
    assert "http" not in re.sub(r"base64,[^\"]+", "", text), "nothing is fetched"


def test_the_page_says_why_there_is_no_figure(pair, results, clouds, history, tmp_path):
    (tmp_path / "others").mkdir()
    other = {key: cloud + np.float32(0.1) if key.endswith("input") else cloud for key, cloud in clouds.items()}
    third = put(tmp_path / "others", results, other, history, name="third", touches=2)
    runs = [read_run(folder) for folder in (*pair, third)]
    compared = report.comparison([run.results for run in runs], "study")
    text = report.write_comparison(compared, runs, pair[0].parent).read_text(encoding="utf-8")
    assert "<img" not in text
    assert "the input of &#x27;test/gear/0000&#x27; is not that of" in text
