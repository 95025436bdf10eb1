import json

import numpy as np
import pytest
from safetensors.numpy import save_file

from pcsr.errors import UserError
from pcsr.report.results import parse_results, read_examples, read_history, read_results


def change(results, path, value):
    *parents, last = path
    for key in parents:
        results = results[key]
    results[last] = value


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["groups"], ["gear"], "6 objects but 1 groups"),
        (["methods", 1, "values", "hd"], [0.1], "'midpoint' has 1 values of hd for 6 objects"),
        (["methods", 0, "values", "cd"], [float("nan")] * 6, "methods.0.values.cd.0"),
        (["methods", 0, "values"], {}, "'tapsr' has 0 values of cd"),
        (["data", "points"], "many", "data.points"),
        (["metrics"], {}, "metrics"),
        (["objects"], [], "objects"),
    ],
)
def test_malformed_results_are_named(results, tmp_path, path, value, named):
    change(results, path, value)
    file = tmp_path / "results.json"
    file.write_text(json.dumps(results), encoding="utf-8")
    with pytest.raises(UserError) as error:
        read_results(file)
    assert named in str(error.value)
    assert str(file) in str(error.value)
    assert "pcsr run" in str(error.value)


@pytest.mark.parametrize("text", [b"{", b"[]", b"\xff", b"null"])
def test_results_that_are_no_json_object_are_named(tmp_path, text):
    file = tmp_path / "results.json"
    file.write_bytes(text)
    with pytest.raises(UserError, match=r"results\.json.*do `pcsr run` again"):
        read_results(file)


def test_history_is_read_and_absence_is_none(run, history):
    assert read_history(run / "metrics.jsonl") == history
    assert read_history(run / "none.jsonl") is None


@pytest.mark.parametrize(
    "line",
    [
        "{",
        "[]",
        '{"loss": 1}',
        '{"step": 1}',
        '{"step": 1, "loss": "low"}',
        '{"step": 1, "loss": NaN}',
        '{"step": 1, "loss": 1, "losses": 2}',
        '{"step": 1, "validation": 1}',
    ],
)
def test_a_malformed_line_is_named_by_number(run, line):
    with (run / "metrics.jsonl").open("a", encoding="utf-8") as file:
        file.write(line + "\n")
    with pytest.raises(UserError, match=r"metrics\.jsonl:32: .*do `pcsr run` again"):
        read_history(run / "metrics.jsonl")


def test_examples_are_read_as_they_were_saved(run, clouds):
    first, second = read_examples(run / "examples.safetensors", ["tapsr", "midpoint"])
    assert second.name == "test/gear/0001"
    assert list(first.predictions) == ["tapsr", "midpoint"]
    np.testing.assert_array_equal(first.touches, clouds["0/touches"])
    np.testing.assert_array_equal(second.predictions["midpoint"], clouds["1/midpoint"])


@pytest.mark.parametrize(
    ("key", "cloud", "named"),
    [
        ("0/tapsr", None, "0/tapsr"),
        ("1/truth", np.full((4, 3), np.nan, np.float32), "1/truth"),
        ("1/input", np.zeros((4, 2), np.float32), "1/input"),
        ("1/input", np.zeros((0, 3), np.float32), "1/input"),
    ],
)
def test_a_missing_or_unusable_cloud_is_named(tmp_path, clouds, key, cloud, named):
    clouds = {k: c for k, c in {**clouds, key: cloud}.items() if c is not None}
    save_file(clouds, tmp_path / "e.safetensors", {"names": '["a", "b"]'})
    with pytest.raises(UserError, match=f"e.safetensors.*{named}.*do `pcsr run` again"):
        read_examples(tmp_path / "e.safetensors", ["tapsr"])


def test_files_that_are_no_examples_are_named(tmp_path, clouds):
    file = tmp_path / "e.safetensors"
    with pytest.raises(UserError, match=r"e\.safetensors is missing"):
        read_examples(file, [])
    file.write_bytes(b"not tensors")
    with pytest.raises(UserError, match=r"e\.safetensors is no file of examples"):
        read_examples(file, [])
    save_file(clouds, file)  # without names
    with pytest.raises(UserError, match=r"e\.safetensors is no file of examples"):
        read_examples(file, [])


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["plain"], [0.1], "touch.plain has 1 values for 6 objects"),
        (["counts"], [1, 2], "touch: 'counts' has 2 values for 3 distances"),
        (["errors", "tapsr"], [0.1], "touch: 'tapsr' has 1 values for 3 distances"),
        (["replaced"], [float("nan")] * 6, "touch.replaced.0"),
    ],
)
def test_a_malformed_touch_effect_is_named(results, touch, path, value, named):
    change(touch, path, value)
    with pytest.raises(UserError) as error:
        parse_results(results)
    assert named in str(error.value)


def test_the_touch_efficiency_is_the_ratio_of_means_and_old_results_have_none(results, touch):
    assert parse_results(results).touch.efficiency == pytest.approx(1 / 3)
    touch["touched"][0] = 6.0e-4
    assert parse_results(results).touch.efficiency == pytest.approx(5 / 18)
    touch["replaced"] = touch["plain"]
    assert parse_results(results).touch.efficiency is None
    del results["touch"]
    assert parse_results(results).touch is None
