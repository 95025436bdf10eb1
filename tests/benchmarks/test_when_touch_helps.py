"""benchmarks/when_touch_helps.py on made-up results: which rows count, what the numbers are, and where they go."""

import importlib
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.stats import ttest_rel

from pcsr.errors import UserError

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "when-touch-helps.md").read_text(encoding="utf-8")
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    modules = ("when_touch_helps", "touch_studies", "touch_charts", "touch_errors")
    script, studies, charts, errors = map(importlib.import_module, modules)

OBJECTS = ("a", "b", "c", "d")
PLAIN = {"a": 3e-3, "b": 1e-3, "c": 2e-3, "d": 6e-3}
FACTOR = {"a": 0.8, "b": 0.9, "c": 1.1, "d": 0.5}
EDGES, ERRORS = [0.0, 0.1, 0.4], [1e-3, None, 3e-3]


@pytest.fixture
def made(tmp_path):
    """Write the results of a run; with every touch the error changes as `FACTOR` says once more."""

    def make(name, touches=4, *, objects=OBJECTS, beside=(), weights="w/frames.safetensors", sha="f" * 64, **of):
        has_touch, view = of.pop("has_touch", True), {"cameras": 1, "noise": of.pop("noise", 0.0)}
        touched = [PLAIN[one] * FACTOR[one] ** touches for one in objects]
        plain = [PLAIN[one] for one in objects]
        methods = [(name, touched), *((one, [1e-3 * (k + 1)] * len(objects)) for k, one in enumerate(beside))]
        options = {"use": "digit", "object_size": 30.0, "policy": "uniform", "depth_noise": 0.02, "position_noise": 0.0}
        data = {"seed": of.pop("seed", 0), "registration": of.pop("registration", None), "view": view}
        data["sampling"] = of.pop("sampling", "random")
        change = of.pop("change", 1.0)
        touched = [change * one for one in touched]
        methods[0] = (name, touched)
        options |= of
        options["policy"] = {"use": options["policy"], "spacing": 20.0, "tries": 100}
        options["noise"] = {key: options.pop(key) for key in list(options) if key.endswith("_noise")}
        data["touch"] = options
        results = {
            "name": name,
            "fingerprint": "ab",
            "seed": 0,
            "version": "1",
            "recipe": {"name": name, "data": data, "weights": {"use": weights, "sha256": sha}},
            "data": {"shapes": "cad-parts", "split": "test", "points": 8, "truth": 32, "rate": 4, "touches": touches}
            | {"sampling": "random", "normalisation": "unit", "coverage": 0.0123 * touches},
            "metrics": {"cd": {"description": "chamfer", "scale": 1000.0}},
            "objects": list(objects),
            "groups": list(objects),
            "methods": [{"name": one, "parameters": 1, "seconds": 1.0, "values": {"cd": of}} for one, of in methods],
            "touch": {
                "touched": touched,
                "plain": plain,
                "replaced": [one / 2 for one in plain],
                "seconds": 1.0,
                "edges": EDGES,
                "counts": [5, 0, 1234],
                "errors": dict.fromkeys((name, f"{name} without touch", *beside), ERRORS),
            }
            if has_touch
            else None,
            "created": "2026",
        }
        path = tmp_path / "runs" / f"{name}-{sha[:4]}" / "results.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(results), encoding="utf-8")
        return path

    return make


@pytest.fixture
def runs(tmp_path):
    return tmp_path / "runs"


def test_rows_are_sorted_by_what_is_varied_and_other_runs_are_left_alone(made, runs):
    made("size-b", 5, object_size=30.0)
    made("size-a", 4, object_size=120.0)
    made("size-c", 1, object_size=30.0)
    made("size-d", 4, object_size=30.0, weights="tapsr", sha="e" * 64)
    made("policy-x", 1, policy="sparse")
    made("smoke", 4)
    found = studies.read(runs)
    assert list(found) == ["size", "policy"]
    assert [row.name for row in found["size"]] == ["size-c", "size-b", "size-a", "size-d"]
    assert [row.settings[studies.NETWORK] for row in found["size"]] == ["frames"] * 3 + ["tapsr"]
    assert [row.name for row in studies.own(found["size"])] == ["size-c", "size-b", "size-a"]
    assert studies.around(found["size"]).name == "size-a"
    assert studies.around([]) is None


def test_all_rows_of_a_study_are_of_the_objects_that_all_have(made, runs):
    made("policy-a", 2, objects=("d", "c", "b"), policy="grasp", beside=("midpoint",))
    made("policy-b", 1, objects=("a", "b", "c"), policy="uniform")
    grasp, uniform = studies.read(runs)["policy"]
    assert grasp.plain == pytest.approx([2.0, 1.0])
    assert grasp.touched == pytest.approx([2.0 * 1.1**2, 0.9**2])
    assert uniform.plain == pytest.approx([1.0, 2.0])
    assert uniform.replaced == pytest.approx([0.5, 1.0])
    assert grasp.beside == pytest.approx({"midpoint": 1.0})
    assert (grasp.touches, uniform.coverage) == (2, 0.0123)


def test_the_standard_error_is_that_of_a_paired_test(made, runs):
    made("vision-a")
    (row,) = studies.read(runs)["vision"]
    assert row.change / row.error == pytest.approx(ttest_rel(row.touched, row.plain).statistic)
    assert row.change == pytest.approx(row.touched.mean() - row.plain.mean())


def test_of_one_object_there_is_no_standard_error(made, runs):
    made("vision-a", objects=("b",))
    (row,) = studies.read(runs)["vision"]
    assert math.isnan(row.error)
    assert "± nan" in script.table([row], [studies.CAMERA])


def test_runs_that_do_not_belong_together_are_refused(made, runs):
    with pytest.raises(UserError, match=r"runs holds no run of a study: `pcsr run touch/size --runs \S+runs`"):
        studies.read(runs)
    made("size-a", objects=("a", "b"))
    old = made("size-a", sha="0" * 64)
    with pytest.raises(UserError, match=r"size-a-0000.* and .*size-a-ffff.* are both 'size-a': delete the one"):
        studies.read(runs)
    old.unlink()
    made("vision-b", sha="1" * 64)
    with pytest.raises(UserError, match=r"'size-a' and 'vision-b' are by different weights 'frames' \(f{12} and 1{12}"):
        studies.read(runs)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"has_touch": False}, "run 'size-b' has no touches, no cd or no weights"),
        ({"objects": ("c",)}, "the runs size-a, size-b have no object in common"),
    ],
)
def test_runs_that_cannot_be_counted_are_refused(made, runs, changes, message):
    made("size-a", objects=("a", "b"))
    made("size-b", **changes)
    with pytest.raises(UserError, match=message):
        studies.read(runs)


def test_a_line_of_a_table_says_what_was_measured(made, runs):
    made("occlusion-a", 1, objects=("a", "b"), policy="sparse", beside=("midpoint", "floor"))
    made("occlusion-b", 2, objects=("a", "b"), policy="sparse")
    heads, rule, first, second, empty, below = script.table(
        studies.read(runs)["occlusion"], studies.STUDIES["occlusion"]
    ).splitlines()
    assert heads.startswith("| policy | touches | coverage | cd ×10³ without touch | with touch | change ± standard")
    assert rule == "|" + " --- |" * heads[1:].count("|")
    # 3 and 1 become 2.4 and 0.9: -0.35 ± 0.25 of 2; half of 2 could be taken.
    assert first == "| sparse | 1 | 1.23% | 2.000 | 1.650 | -0.350 ± 0.250 (-17.5%) | 2/2 | 0.350 | 1.000 | 2.000 |"
    assert second.startswith("| sparse | 2 | 2.46% | 2.000 | 1.365 | -0.635 ± ")
    assert second.endswith(" | 0.635 |  |  |")
    assert (empty, below) == ("", f"2 objects. Weights: `frames` {'f' * 12}.")


WORDS = st.text("ab \n<>!-\\g<0>", max_size=30)


@given(WORDS, WORDS, WORDS, WORDS, WORDS)
def test_tables_take_the_place_of_what_stood_between_their_markers_alone(before, old, middle, after, new):
    page = f"{before}<!-- x -->{old}<!-- /x -->{middle}<!-- y -->kept<!-- /y -->{after}"
    filled = script.fill(page, {"x": new})
    assert filled == f"{before}<!-- x -->\n\n{new}\n\n<!-- /x -->{middle}<!-- y -->kept<!-- /y -->{after}"
    assert script.fill(filled, {"x": new}) == filled
    both = script.fill(page, {"x": new, "y": old})
    assert both == script.fill(script.fill(page, {"y": old}), {"x": new})


@pytest.mark.parametrize(
    "page", ["", "<!-- x -->", "<!-- /x --> <!-- x -->", "<!-- x --> <!-- x --> <!-- /x -->", "<!--x--><!-- /x -->"]
)
def test_markers_that_are_missing_or_double_are_refused(page):
    with pytest.raises(UserError, match=r"p.md must have <!-- x --> and after it <!-- /x -->, each once"):
        script.fill(page, {"x": "table"}, "p.md")


def test_a_line_over_touches_begins_without_touch_and_leaves_out_what_was_not_measured(made, runs):
    made("policy-a", 1, policy="sparse")
    made("policy-b", 3, policy="sparse")
    made("policy-c", 2, policy="uniform")
    rows = studies.read(runs)["policy"]
    x, lines = charts.over_touches(rows, lambda row: row.settings[studies.POLICY])
    assert x == [0, 1, 2, 3]
    first, second = rows[0], rows[1]
    means, spreads = lines["sparse"]
    np.testing.assert_allclose(means, [3.0, first.touched.mean(), math.nan, second.touched.mean()])
    np.testing.assert_allclose(spreads, [math.nan, first.error, math.nan, second.error])
    np.testing.assert_allclose(lines["uniform"][0], [3.0, math.nan, rows[2].touched.mean(), math.nan])


PRIOR = {"position": 1.0, "rotation": 2.0}


@pytest.fixture
def sensor(made, runs):
    """Rows of the study of errors: two draws of an exact arm and of one with errors, one of a noisy sensor."""
    arm = {"position_noise": 1.0, "rotation_noise": 2.0}
    made("sensor-depth", 1, depth_noise=0.3)
    made("sensor-exact-0", 1)
    made("sensor-exact-1", 1, seed=1, objects=("a", "b", "c"))
    made("sensor-arm-0", 1, change=1.5, **arm)
    made("sensor-arm-1", 1, change=2.0, seed=1, **arm)
    made("sensor-arm-0-registered", 1, change=1.12, registration=PRIOR, **arm)
    made("sensor-arm-1-registered", 1, change=1.2, registration=PRIOR, seed=1, **arm)
    made("sensor-shared", 1, change=1.5, sampling="view", policy="sparse", shared_position_noise=1.0)
    return studies.read(runs)["sensor"]


def mean_change(*factors):
    """Mean over the objects of what a touch changes, mean over draws: the first has all objects, the second three."""
    changes = [
        np.mean([1e3 * PLAIN[one] * (factor * FACTOR[one] - 1) for factor in factors[: 1 if one == "d" else 2]])
        for one in OBJECTS
    ]
    return np.mean(changes), np.std(changes, ddof=1) / 2


def test_settings_have_their_draws_and_objects_are_in_all_rows_of_a_draw(sensor):
    settings = errors.settings_of(sensor)
    assert [(one.settings[studies.POSITION], one.settings[studies.DEPTH]) for one in settings] == [
        (0.0, 0.02), (0.0, 0.3), (1.0, 0.02), (0.0, 0.02),
    ]  # fmt: skip
    exact, depth, arm, shared = settings
    assert [row.objects for row in arm.registered.rows] == [OBJECTS, ("a", "b", "c")]
    assert (exact.registered, depth.registered, shared.registered) == (None, None, None)
    for draws, factors in ((exact.reported, (1, 1)), (arm.reported, (1.5, 2.0)), (arm.registered, (1.12, 1.2))):
        assert (draws.change, draws.error) == pytest.approx(mean_change(*factors))
        assert draws.count == 7
        assert draws.plain == pytest.approx(3.0)
    assert arm.registered.worse == 3, "c in both draws, b in the second; in the first it is worse by 0.8 %"


def test_the_table_of_errors_shows_what_registration_keeps_of_an_exact_arm(sensor):
    heads, _, *lines, empty, below = script.sensor_table(sensor).splitlines()
    cells = [dict(zip(heads.strip("| ").split(" | "), line[2:-2].split(" | "), strict=True)) for line in lines]
    exact, _, arm, shared = cells
    assert [one["cloud"] for one in cells] == ["random points"] * 3 + ["1 camera, touches sparse"]
    assert [one["error of each touch, mm / °"] for one in cells] == ["0 / 0", "0 / 0", "1 / 2", "0 / 0"]
    assert [one["shared error, mm / °"] for one in cells] == ["0 / 0"] * 3 + ["1 / 0"]
    assert [one["parts × draws"] for one in cells] == ["7 (2 draws)", "4 (1 draw)", "7 (2 draws)", "4 (1 draw)"]
    gain, _ = mean_change(1, 1)
    after, error = mean_change(1.12, 1.2)
    assert arm["change, registered"] == f"{after:+.3f} ± {error:.3f} ({after / 3:+.1%})"
    assert arm["gain kept"] == f"{after / gain:.0%}"
    assert arm["worse by over 1%"] == "3/7"
    assert arm["coverage"] == "1.2% → 1.2%"
    assert (exact["gain kept"], shared["gain kept"], shared["change, registered"]) == ("", "", "")
    assert (empty, below) == ("", f"Weights: `frames` {'f' * 12}.")


def test_touches_as_reported_and_registered_are_lines_over_the_error_of_the_arm(sensor):
    x, lines = charts.over_error(errors.settings_of(sensor))
    assert x == ["0 / 0", "1 / 2"]
    assert list(lines) == ["without touch", "as reported", "registered"]
    np.testing.assert_allclose(lines["without touch"][0], [3.0, 3.0])
    exact, reported, registered = mean_change(1, 1), mean_change(1.5, 2.0), mean_change(1.12, 1.2)
    np.testing.assert_allclose(lines["as reported"][0], [3 + exact[0], 3 + reported[0]])
    np.testing.assert_allclose(lines["as reported"][1], [exact[1], reported[1]])
    np.testing.assert_allclose(lines["registered"], [[math.nan, 3 + registered[0]], [math.nan, registered[1]]])


def test_the_error_around_touches(made, runs):
    made("size-a", beside=("floor",))
    (row,) = studies.read(runs)["size"]
    x, lines = charts.by_distance(row)
    assert x == ["0 to 0.1", "0.1 to 0.4", "from 0.4"]
    assert list(lines) == ["without touch", "4 touches", "floor"]
    for means, spread in lines.values():
        np.testing.assert_allclose(means, [1.0, math.nan, 3.0])
        assert spread is None
    assert script.distance_table(row).splitlines()[2:] == [
        "| 0 to 0.1 | 5 | 1.000 | 1.000 | 1.000 |",
        "| 0.1 to 0.4 | 0 |  |  |  |",
        "| from 0.4 | 1,234 | 3.000 | 3.000 | 3.000 |",
    ]


@pytest.fixture
def all_studies(made):
    """A row or more of each."""
    for size in (30.0, 60.0):
        for touches in (1, 4):
            made(f"size-{size:g}-{touches}", touches, object_size=size, beside=("midpoint",))
        made(f"size-tapsr-{size:g}", object_size=size, weights="tapsr")
    for noise in (0.0, 0.01):
        made(f"vision-{noise}", noise=noise, beside=("midpoint", "floor"))
    made("occlusion-a", policy="sparse")
    made("sensor-a")
    made("policy-a")


def test_the_command_writes_tables_and_pictures_together(all_studies, runs, tmp_path):
    page, out = tmp_path / "page.md", tmp_path / "pictures"
    page.write_text(PAGE, encoding="utf-8")
    result = CliRunner().invoke(script.main, [str(runs), "-o", str(out), "--page", str(page)])
    assert result.exit_code == 0, result.output
    filled = page.read_text(encoding="utf-8")
    for name in (*studies.STUDIES, "distance"):
        (text,) = re.findall(rf"<!-- {name} -->\n\n(\|.*?)\n\n<!-- /{name} -->", filled, re.DOTALL)
        assert f"## {name}\n\n{text}\n" in result.output
    linked = set(re.findall(r"\(pictures/(\S+)\)", PAGE))
    assert linked == {path.name for path in out.iterdir()}, "the page shows what is drawn"
    for path in out.iterdir():
        with Image.open(path) as image:
            assert len(image.getcolors(image.width * image.height)) > 10, "there is more than paper and ink"


def test_without_a_page_nothing_but_pictures_is_written(all_studies, runs, tmp_path):
    before = set(tmp_path.rglob("*"))
    result = CliRunner().invoke(script.main, [str(runs), "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert {path.name for path in set(tmp_path.rglob("*")) - before} == set(re.findall(r"\(pictures/(\S+)\)", PAGE))


def test_a_page_without_markers_stays_as_it_is_and_nothing_is_drawn(all_studies, runs, tmp_path):
    page, out = tmp_path / "page.md", tmp_path / "pictures"
    page.write_text("nothing", encoding="utf-8")
    result = CliRunner().invoke(script.main, [str(runs), "-o", str(out), "--page", str(page)])
    assert result.exit_code == 1
    assert "must have <!-- size -->" in result.output
    assert page.read_text(encoding="utf-8") == "nothing"
    assert not out.exists()


def test_what_was_not_run_stays_as_it_is(made, runs, tmp_path):
    made("policy-a")
    page = tmp_path / "page.md"
    old = PAGE.replace("<!-- size -->", "<!-- size -->\nold numbers")
    page.write_text(old, encoding="utf-8")
    result = CliRunner().invoke(script.main, [str(runs), "-o", str(tmp_path / "p"), "--page", str(page)])
    assert result.exit_code == 0, result.output
    assert "<!-- size -->\nold numbers" in page.read_text(encoding="utf-8")
    assert [path.name for path in (tmp_path / "p").iterdir()] == ["when-policy.png"]


def test_the_page_names_every_study():
    assert re.findall(r"pcsr run touch/(\w+)\n", PAGE) == list(studies.STUDIES)
    assert f"for study in {' '.join(studies.STUDIES)}; do" in PAGE
