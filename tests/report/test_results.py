"""`results.json`: what is refused, and what stays as it was written."""

import json

import pytest

from pcsr.errors import UserError
from pcsr.results import parse_results, read_results, write_results


def change(results, path, value):
    *parents, last = path
    for key in parents:
        results = results[key]
    results[last] = value


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["name"], "", "name: "),
        (["name"], "\x1b[31mred", "name: "),
        (["groups"], ["gear"], "6 objects but 1 groups"),
        (["methods", 1, "values", "hd"], [0.1], "'midpoint' has 1 values of hd for 6 objects"),
        (["methods", 0, "values", "cd"], [float("nan")] * 6, "methods.0.values.cd.0"),
        (["methods", 0, "values", "cd"], [1.7e308] * 6, "methods.0.values.cd.0: it must be less than 1e+100"),
        (["methods", 0, "values"], {}, "'tapsr' has 0 values of cd"),
        (["data", "points"], "many", "data.points"),
        (["metrics"], {}, "metrics"),
        (["objects"], [], "objects"),
        (["recipe"], {}, "recipe.train.epochs is missing"),
        (["recipe", "train"], {}, "recipe.train.epochs"),
        (["recipe", "train", "epochs"], 0, "recipe.train.epochs: it must be 1 or more, got 0"),
        (["recipe", "train"], None, "recipe.train"),
        (["recipe", "evaluate"], {"published": {"cd": "low"}}, "recipe.evaluate.published.cd"),
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


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["plain"], [0.1], "touch.plain has 1 values for 6 objects"),
        (["counts"], [1, 2], "touch: 'counts' has 2 values for 3 distances"),
        (["errors", "tapsr"], [0.1], "touch: 'tapsr' has 1 values for 3 distances"),
        (["replaced"], [float("nan")] * 6, "touch.replaced.0"),
        (["exchanged"], [1e308] * 6, "touch.exchanged.0: it must be less than 1e+100"),
        (["plain"], [-1.0] * 6, "touch.plain.0: it must be 0 or more"),
        (["exchanged"], [0.1] * 5, "touch.exchanged has 5 values for 6 objects"),
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
    assert parse_results(results).touch.exchanged_efficiency is None
    touch["exchanged"] = [6.5e-4] * 6
    assert parse_results(results).touch.exchanged_efficiency == pytest.approx(-1 / 6)
    touch["replaced"] = touch["plain"]
    assert parse_results(results).touch.efficiency is None
    del results["touch"]
    assert parse_results(results).touch is None


def test_a_recipe_is_not_needed_where_no_time_of_training_is_known(results):
    results["recipe"] = {}
    del results["training"]["seconds"]
    assert parse_results(results).seconds_per_epoch is None


def test_the_time_of_an_epoch_is_that_of_the_training_over_its_epochs(results):
    assert parse_results(results).seconds_per_epoch == 360


@pytest.mark.parametrize("field", ["touch", "protocol", "timing", "hardware"])
def test_a_file_is_written_as_it_was_read(results, touch, tmp_path, field):
    """To the byte: integers stay integers, what is absent stays absent, and what is unknown of a training is kept."""
    results["protocol"] = "as pcsr upsample"
    results["timing"], results["hardware"] = "median", {"cores": 2, "load": 0.5, "note": "ü"}
    results["training"] = {"seconds": 5, "steps": 9, "device": "1 x cpu", "threads": None, "validation": {"cd": 1e-05}}
    results["training"] |= {"source": "this run"}
    del results[field]
    path = tmp_path / "results.json"
    path.write_text(json.dumps(ordered(results), indent=1), encoding="utf-8")
    write_results(tmp_path / "again.json", read_results(path))
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def ordered(results):
    """Results in the order in which pcsr writes them."""
    order = "name fingerprint seed version recipe data metrics objects groups methods touch training protocol timing"
    data = "shapes split points truth rate touches sampling seed normalisation object_size coverage left_out"
    results["data"] = {key: results["data"][key] for key in data.split() if key in results["data"]}
    return {key: results[key] for key in (*order.split(), "hardware", "created") if key in results}
