"""Runs on other clouds are told apart, and the message names what differs."""

import copy

import pytest

from pcsr.errors import UserError
from pcsr.report.tables.same_clouds import check_same_clouds, check_same_settings, cloud_settings, same_clouds
from pcsr.results import parse_results

RADII = [0.5, 0.6, 0.7, 0.8, 0.9, 0.55]


@pytest.fixture
def run(results):
    def make(radii=None, **data):
        made = copy.deepcopy(results)
        made["data"] |= data | ({"radii": radii} if radii else {})
        return parse_results(made)

    return make


def refused(one, other):
    with pytest.raises(UserError) as error:
        check_same_clouds([("runs/a", one), ("runs/b", other)])
    return str(error.value)


@pytest.mark.parametrize(
    ("changes", "same"),
    [({}, True), ({"touches": 0}, True), ({"points": 32}, False), ({"truth": 512}, False), ({"seed": 3}, False)],
)
def test_without_radii_the_settings_decide(run, changes, same):
    assert same_clouds(run(), run(**changes)) is same
    assert same_clouds(run(**changes), run()) is same


def test_with_radii_the_clouds_decide(run):
    assert same_clouds(run(RADII), run([radius * (1 + 1e-6) for radius in RADII], sampling="fps"))
    assert not same_clouds(run(RADII), run([*RADII[:5], 0.56]))
    assert same_clouds(run(RADII), run()), "the older one has none"


def test_radii_have_the_length_of_the_objects(run):
    with pytest.raises(UserError, match=r"data\.radii has 2 values for 6 objects"):
        run(RADII[:2])


def test_the_message_names_the_settings_that_differ(run, results):
    one = run(RADII)
    results["recipe"]["data"]["points"], results["recipe"]["data"]["seed"] = 32, 5
    other = run(RADII, points=32)
    assert refused(one, other) == (
        "runs/b was measured on other clouds than runs/a: data.points is 32, not 64; compare runs on the same test data"
    )


def test_where_the_recipes_agree_the_message_names_the_data(run, results):
    one = run()
    assert "seed is 3, not None" in refused(one, run(seed=3)).replace("null", "None")
    assert "the objects or their points" in refused(run(RADII), run(RADII[::-1]))
    for key in ("objects", "groups"):
        results[key] = results[key][:4]
    for method in results["methods"]:
        method["values"] = {metric: values[:4] for metric, values in method["values"].items()}
    assert "objects is 4, not 6" in refused(one, run())


def test_a_metric_of_another_meaning_is_refused(run, results):
    one = run()
    results["metrics"]["hd"]["description"] = "mean of the greatest distances"
    assert refused(one, run()).startswith("runs/b: metric 'hd' is 'mean of the greatest distances' (×1000), in runs/a")


def test_recipes_are_compared_before_they_are_run():
    data = {
        "points": 128,
        "rate": 4,
        "sampling": "random",
        "shapes": {"use": "balls", "count": 9},
        "view": {"noise": 0},
    }
    one = {"seed": 0, "data": {**data, "seed": None}, "evaluate": {"objects": 8}}
    other = {"seed": 1, "data": {**data, "seed": 0, "touches": 3, "view": {"noise": 1}}, "evaluate": {"objects": 8}}
    check_same_settings([("a", one), ("b", other)])
    with pytest.raises(
        UserError, match=r"b has other test data than a: data.seed is 1, not 0, evaluate.objects is null"
    ):
        check_same_settings([("a", one), ("b", {"seed": 1, "data": data, "evaluate": {"objects": None}})])
    older = {"seed": 0, "data": {"points": 128}}
    check_same_settings([("a", one), ("b", older)])
    assert "data.view" not in cloud_settings(one)
    assert "data.view" in cloud_settings({"seed": 0, "data": {**data, "sampling": "view"}})
