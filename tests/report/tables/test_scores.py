import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.report.tables.scores import efficiency_cell, group_means, scaled, scores
from pcsr.report.tables.significance import clear_best, pairwise
from pcsr.results import parse_results


def test_scores_are_what_the_statistics_module_says(results):
    rows = scores(parse_results(results))
    baseline = results["methods"][1]["values"]
    for method, row in zip(results["methods"], rows, strict=True):
        for metric, values in method["values"].items():
            score = row[metric]
            assert score.mean == pytest.approx(1000 * statistics.mean(values))
            assert score.deviation == pytest.approx(1000 * statistics.stdev(values))
            wins = sum(ours < theirs for ours, theirs in zip(values, baseline[metric], strict=True))
            assert score.wins == (None if method["name"] == "midpoint" else wins)


def test_the_best_of_a_column_is_that_of_the_statistics(results):
    results["objects"], results["groups"] = [str(k) for k in range(9)], ["all"] * 9
    rng = np.random.default_rng(0)
    for k, method in enumerate(results["methods"]):
        # In cd the methods differ by far, in hd the first two do not.
        method["values"] = {"cd": (rng.uniform(1, 2, 9) + k).tolist(), "hd": (rng.uniform(1, 2, 9) + k // 2).tolist()}
    rows = scores(parse_results(results))
    for metric in results["metrics"]:
        values = np.array([method["values"][metric] for method in results["methods"]])
        best = clear_best(values, pairwise(values))
        assert [row[metric].best for row in rows] == [k == best for k in range(3)]
    assert [row["cd"].best for row in rows] == [True, False, False]
    assert not any(row["hd"].best for row in rows)


def test_an_equal_value_is_no_win(results):
    results["methods"][0]["values"] = results["methods"][1]["values"]
    assert scores(parse_results(results))[0]["cd"].wins == 0


def test_a_single_object_has_no_spread_and_a_single_method_no_rival(results):
    results["objects"], results["groups"] = ["test/gear/0000"], ["gear"]
    results["methods"] = [{**results["methods"][0], "values": {"cd": [0.5], "hd": [0.25]}}]
    (row,) = scores(parse_results(results))
    assert (row["cd"].deviation, row["cd"].best, row["cd"].wins) == (0.0, False, None)
    assert str(row["cd"]) == "500 ± 0"


@given(st.floats(1e-6, 1e3))
def test_a_cell_shows_three_significant_digits(value):
    data = {"shapes": "s", "split": "test", "points": 1, "truth": 1, "rate": 1, "touches": 0, "sampling": ""}
    about = {"name": "n", "fingerprint": "f", "seed": 0, "version": "0", "recipe": {}, "created": ""}
    one = {"objects": ["o"], "groups": ["g"], "metrics": {"cd": {"description": "", "scale": 1}}}
    method = {"name": "m", "parameters": 0, "seconds": 0, "values": {"cd": [value]}}
    results = parse_results({**about, **one, "data": {**data, "normalisation": ""}, "methods": [method]})
    shown = float(str(scores(results)[0]["cd"]).split(" ± ")[0])
    assert shown == pytest.approx(value, rel=0.0051)


def test_group_means_are_the_plain_means(results):
    means = group_means(parse_results(results), "cd")
    assert list(means) == sorted(set(results["groups"]))
    for group, values in means.items():
        for method, value in zip(results["methods"], values, strict=True):
            own = [v for v, g in zip(method["values"]["cd"], results["groups"], strict=True) if g == group]
            assert value == pytest.approx(1000 * statistics.mean(own))


@pytest.mark.parametrize(
    ("scale", "shown"), [(1000.0, "cd ×10³"), (1.0, "cd"), (1e12, "cd ×10¹²"), (0.01, "cd ×10⁻²"), (50.0, "cd ×50")]
)
def test_a_heading_says_its_scale(scale, shown):
    assert scaled("cd", scale) == shown


def test_the_change_is_the_mean_beside_the_baselines(results):
    row = scores(parse_results(results))[0]["cd"]
    ours, theirs = (sum(m["values"]["cd"]) for m in results["methods"][:2])
    assert row.change == pytest.approx(ours / theirs - 1)


def test_the_floor_is_no_rival(results):
    before = scores(parse_results(results))
    results["methods"].append(
        {**results["methods"][1], "name": "floor", "values": {"cd": [1e-9] * 6, "hd": [1e-9] * 6}}
    )
    *rivals, floor = scores(parse_results(results))
    assert rivals == before
    assert not any(score.best for score in floor.values())
    assert str(floor["cd"]) == "0.000 ± 0.000"
    assert floor["cd"].wins == 6
    results["methods"] = [results["methods"][0], results["methods"][-1]]
    assert not any(score.best for row in scores(parse_results(results)) for score in row.values())


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ([0.25], "0.250"),
        ([-1e-9], "0.000"),
        ([-0.5], "-0.500"),
        ([0.1, 0.3], "0.200 ± 0.141"),
        ([0.1, None], "0.100"),
        ([None], "–"),
        ([], "–"),
    ],
)
def test_an_efficiency_has_three_digits_and_is_a_dash_without_touch(values, shown):
    assert efficiency_cell(values) == shown
    assert efficiency_cell(values, [None]) == shown
    assert efficiency_cell(values, [0.2, None, 0.4]) == f"{shown}\nanother object's 0.300"
